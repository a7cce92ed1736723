"""What the command's exit codes mean; 0 is done."""

NOTHING_FOUND = 1
BAD_INPUT = 2
NO_GRAPHICS = 3
INTERRUPTED = 130
