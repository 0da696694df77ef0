"""Batch experiments: one TOML file in, one folder of results, charts and a report out.

    experiment.toml --experiment--> Task --solving--> rows --store--> parquet files --load--> tables

Tasks of one shape are solved in one compiled call; results are kept as they come, so that a run
that was stopped goes on where it was (extra ``sweep``).
"""
