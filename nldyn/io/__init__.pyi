"""Files of results: the names that are not in the face of nldyn."""

from nldyn.io.checkpoint import CheckpointFile as CheckpointFile
from nldyn.io.history_files import write_history as write_history
