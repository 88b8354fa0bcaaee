"""Where recording and simulation differ, which physics was left out, and the better fit."""
