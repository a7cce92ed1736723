"""How code runs: the names that are not in the face of nldyn."""

from nldyn.runtime.executors import run_all as run_all
from nldyn.runtime.progress import Shares as Shares
from nldyn.runtime.progress import progress_line as progress_line
