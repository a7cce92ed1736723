"""What all of cms rests on: names of arrays, the one exception, threads."""
