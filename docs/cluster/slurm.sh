#!/bin/bash
# One job of Slurm: a scheduler, one worker a GPU, and the run. Submit it with: sbatch docs/cluster/slurm.sh
# Change the number of nodes and GPUs, the time, and the last command; nothing else depends on them.
#SBATCH --job-name=shadowbench
#SBATCH --nodes=2
#SBATCH --ntasks-per-node=4
#SBATCH --gpus-per-task=1
#SBATCH --cpus-per-task=8
#SBATCH --exclusive
#SBATCH --time=04:00:00
set -e
source .venv/bin/activate                        # the same environment on every node, with shadowbench-rt[cluster]
ADDRESS=tls://$(hostname):8786

# Other users reach the ports, too: only who has the keys of this job may speak to them.
KEYS=$PWD/.keys-$SLURM_JOB_ID
python docs/cluster/keys.py "$KEYS"
trap 'rm -rf "$KEYS"' EXIT
source "$KEYS/settings"

# A shard is never repeated by Dask itself: shadowbench does that, and says so.
DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES=0 dask scheduler --port 8786 --no-dashboard &
srun --gpu-bind=single:1 dask worker "$ADDRESS" --nthreads 1 --resources GPU=1 --memory-limit 0 --no-dashboard &

sleep 20                                         # whoever comes later joins the run
shadowbench run table1 --preset paper --cluster "$ADDRESS" --out results/local/table1-cluster
