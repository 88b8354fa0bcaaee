"""Instruments on the wire. Each driver turns a real protocol into readings; codecs are sans-I/O."""
