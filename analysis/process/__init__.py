"""From a recorded session to what follows from it: its sky, its measured and its predicted photometry."""
