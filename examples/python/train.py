"""Trains a task of the package with rsl_rl's PPO on the CPU, and says how long its episodes are then.

    pip install . rsl-rl-lib
    python examples/python/train.py                                    # CartPole, which balances
    python examples/python/train.py Stand --iterations 150            # a quadruped that rises and stands
"""

import argparse
import time

import torch
from rsl_rl.runners import OnPolicyRunner

import gsp.rsl_rl
import gsp.tasks

arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
arguments.add_argument("task", nargs="?", default="CartPole", help="class of gsp.tasks")
arguments.add_argument("--worlds", type=int, default=128)
arguments.add_argument("--iterations", type=int, default=80)
arguments.add_argument("--seed", type=int, default=1)
arguments.add_argument("--log", help="folder for TensorBoard and checkpoints")
arguments = arguments.parse_args()

network = {"class_name": "MLPModel", "hidden_dims": [64, 64], "activation": "elu", "obs_normalization": True}
cfg = {
    "num_steps_per_env": 32,
    "save_interval": 100,
    "obs_groups": {"actor": ["policy"], "critic": ["policy"]},
    "actor": {**network, "distribution_cfg": {"class_name": "GaussianDistribution", "init_std": 0.5}},
    "critic": network,
    "algorithm": {"class_name": "PPO", "learning_rate": 1e-3, "entropy_coef": 0.0, "rnd_cfg": None, "symmetry_cfg": None},
}


def evaluate(policy, worlds=64):
    """Mean length [s] and mean reward a step of the first episode of each world, with actions at the policy's mean."""
    env = gsp.rsl_rl.VecEnv(Task(worlds=worlds, seed=arguments.seed + 1000))
    seen, alive = env.get_observations(), torch.ones(worlds, dtype=torch.bool)
    steps, sums = torch.zeros(worlds), torch.zeros(worlds)
    with torch.inference_mode():
        while alive.any():
            seen, rewards, done, _ = env.step(policy(seen))
            steps += alive
            sums += alive * rewards
            alive &= ~done
    return float(steps.mean()) * env.task.dt, float((sums / steps).mean())


Task = getattr(gsp.tasks, arguments.task)
torch.manual_seed(arguments.seed)
env = gsp.rsl_rl.VecEnv(Task(worlds=arguments.worlds, seed=arguments.seed))
runner = OnPolicyRunner(env, cfg, arguments.log, device="cpu")
before = evaluate(runner.get_inference_policy())
begin, cpu = time.perf_counter(), time.process_time()
runner.learn(arguments.iterations, init_at_random_ep_len=True)
seconds, cpu = time.perf_counter() - begin, time.process_time() - cpu
after = evaluate(runner.get_inference_policy())
samples = arguments.iterations * cfg["num_steps_per_env"] * arguments.worlds
print(f"{arguments.task}: {seconds:.1f} s ({cpu:.1f} s of processor time) for {samples:,} steps of control")
for when, (length, reward) in (("before", before), ("after", after)):
    print(f"  {when}: episodes of {length:.2f} s of {env.task.seconds:.0f} s, reward {reward:.3f} a step")
