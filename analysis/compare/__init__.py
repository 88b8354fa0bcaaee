"""Recordings beside what simulations predict for them.

A comparison starts as a case (`analysis.cases`), made of tables by a recipe (`from_tables`), of .ies files
(`from_files`) or of recorded sessions (`from_sessions`); `metrics.compare` says in numbers how far any number of
simulations are from it, `page` writes the report, and `benchmark` packs everything for others.
"""
