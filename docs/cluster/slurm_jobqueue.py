"""A scheduler here, and one job of Slurm for each worker: python docs/cluster/slurm_jobqueue.py run table1 --preset paper

Before that, in the same shell: python docs/cluster/keys.py ~/keys && source ~/keys/settings

Needs dask-jobqueue beside shadowbench-rt[cluster]. A job that ends, or is taken away, is a lost worker: its scene is
measured again by another one, and the results folder says so. Change the arguments to what your site calls for.
"""

import subprocess
import sys

import dask
import distributed
from dask_jobqueue import SLURMCluster

WORKERS = 4

if __name__ == "__main__":
    dask.config.set({"distributed.scheduler.allowed-failures": 0})
    with SLURMCluster(
        cores=1,  # threads of a worker: it measures one scene at a time
        processes=1,
        job_cpu=8,  # cores of the job, for compiling and scoring
        memory="64GB",
        walltime="04:00:00",
        job_extra_directives=["--gpus=1", "--exclusive"],
        worker_extra_args=["--resources", "GPU=1"],
        job_script_prologue=["source .venv/bin/activate", "source ~/keys/settings"],
        protocol="tls",
        security=distributed.Security(),
    ) as cluster:
        cluster.scale(jobs=WORKERS)
        cluster.wait_for_workers(1)
        sys.exit(subprocess.call(["shadowbench", *sys.argv[1:], "--cluster", cluster.scheduler_address]))
