"""What all of fem rests on: names of arrays, the one exception, files that appear whole."""
