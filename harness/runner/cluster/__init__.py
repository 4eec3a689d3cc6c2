"""An experiment on several cards and machines through Dask `distributed`: the scheduler's side and the worker's."""
