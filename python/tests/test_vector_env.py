"""The vector environment: Gymnasium's shapes, names and checks."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
import tractrix
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode


def envs(n: int = 3, **arguments: Any) -> tractrix.VectorEnv:
    arguments = {"scenario": "table2-medium-15", "episode_s": 6.0, **arguments}
    return tractrix.VectorEnv(n, **arguments)


def keep(n: int = 3) -> np.ndarray[Any, Any]:
    return np.ones(n, np.int64)


def test_shapes_names_and_the_end_of_an_episode() -> None:
    env = envs()
    assert env.metadata["autoreset_mode"] == AutoresetMode.SAME_STEP
    obs, infos = env.reset(seed=5)
    assert (
        obs.shape == (3, 237)
        and obs.dtype == np.float32
        and obs in env.observation_space
    )
    assert (
        infos["action_mask"].shape == (3, 3) and (infos["action_mask"][:, 1] == 1).all()
    )
    for step in range(1, 7):
        obs, reward, terminated, truncated, infos = env.step(keep())
        assert reward.shape == terminated.shape == truncated.shape == (3,)
        assert not terminated.any() and (truncated == (step == 6)).all()
        assert ("final_obs" in infos) == (step == 6)
    assert infos["_final_obs"].all() and infos["_final_info"].all()
    assert (infos["final_info"]["decisions"] == 6).all()
    assert infos["final_info"]["seed"].tolist() == [5, 6, 7]
    assert (infos["final_obs"] != obs).any()
    assert 0.0 < infos["final_info"]["delta_speed_frac"].max() < 1.0


def test_the_same_seeds_give_the_same_numbers_on_any_number_of_threads() -> None:
    def drive(threads: int) -> list[bytes]:
        env = envs(threads=threads)
        out = [env.reset(seed=[4, 9, 2])[0].tobytes()]
        for _ in range(8):
            obs, reward, *_ = env.step(keep())
            out += [obs.tobytes(), reward.tobytes()]
        return out

    assert drive(1) == drive(2) == drive(3)


def test_the_window_can_be_set_and_done_without() -> None:
    def drive(**arguments: Any) -> list[bytes]:
        env = envs(scenario="table2-dense-12.5", episode_s=300.0, **arguments)
        env.reset(seed=3)
        return [env.step(keep())[0].tobytes() for _ in range(150)]

    usual, whole = drive(), drive(window_m=(np.inf, np.inf))
    assert usual == drive(window_m=(300.0, 400.0))
    # what comes from beyond the window arrives later
    assert usual[:10] == whole[:10] and usual != whole
    with pytest.raises(ValueError, match=r"window\.behind_m.*1"):
        envs(window_m=(1.0, 400.0))
    with pytest.raises(ValueError, match=r"window\.ahead_m"):
        envs(window_m=(300.0, float("nan")))


def test_those_far_away_can_sleep_on_an_even_road() -> None:
    def drive(**arguments: Any) -> list[bytes]:
        env = envs(scenario="table2-dense-12.5", episode_s=400.0, **arguments)
        env.reset(seed=3)
        return [env.step(keep())[0].tobytes() for _ in range(300)]

    usual, sleepy = drive(), drive(awake_m=500.0)
    assert sleepy == drive(awake_m=500.0)
    # who slept comes near later
    assert usual[:10] == sleepy[:10] and usual != sleepy
    for wrong in (
        {"awake_m": 399.0},
        {"awake_m": 1500.0, "road": "builtin:highway"},
        {"awake_m": 1500.0, "window_m": (np.inf, np.inf)},
    ):
        with pytest.raises(ValueError, match="awake_m"):
            envs(**wrong)


def test_reset_mask_leaves_the_others_alone() -> None:
    env = envs()
    env.reset(seed=1)
    before = env.step(keep())[0]
    after, _ = env.reset(seed=8, options={"reset_mask": np.array([False, True, False])})
    assert (before[[0, 2]] == after[[0, 2]]).all() and (before[1] != after[1]).any()
    with pytest.raises(ValueError, match="reset_mask"):
        env.reset(options={"reset_mask": np.array([True])})


def test_without_copies_the_arrays_are_written_again() -> None:
    env = envs(copy=False)
    first, _ = env.reset(seed=1)
    second = env.step(keep())[0]
    assert first is second
    copied = envs()
    first, _ = copied.reset(seed=1)
    assert first is not copied.step(keep())[0]


def test_advantages_leave_the_environments_as_they_are() -> None:
    env, alone = (envs(8, scenario="table2-sparse-15", episode_s=60.0) for _ in "ab")
    for one in (env, alone):
        one.reset(seed=1)
        for _ in range(20):
            _, _, _, _, infos = one.step(keep(8))
    mask = infos["action_mask"]
    assert mask[:, 0].any()
    for drivers in ("true", "forgotten"):
        out = env.advantages("mobil", horizon_s=15.0, rollouts=2, drivers=drivers)
        assert out.shape == (8, 3) and out.dtype == np.float32
        assert (out[:, 1] == 0.0).all() and (np.isnan(out) == (mask == 0)).all()
    assert (env.step(keep(8))[0] == alone.step(keep(8))[0]).all()
    with pytest.raises(ValueError, match="drivers"):
        env.advantages(drivers="known")
    with pytest.raises(ValueError, match="decider fast"):
        env.advantages("fast")


def test_wishes_are_actions() -> None:
    env = envs(6, scenario="table2-sparse-15", episode_s=200.0)
    env.reset(seed=1)
    assert (env.wishes("keep") == 1).all()
    seen = set()
    for _ in range(120):
        wishes = env.wishes("rules:150")
        seen |= set(wishes.tolist())
        env.step(wishes)
    assert {0, 1} <= seen <= {0, 1, 2}
    with pytest.raises(ValueError, match="External"):
        env.wishes("external")


def test_what_cannot_be_is_named() -> None:
    env = envs()
    with pytest.raises(ValueError, match="reset begins one"):
        env.step(keep())
    env.reset()
    for actions in (np.full(3, np.nan), np.array([0, 1, 3]), np.array([-1, 1, 1])):
        with pytest.raises(ValueError, match="whole numbers 0"):
            env.step(actions)
    with pytest.raises(ValueError, match=r"shape \(2,\)"):
        env.step(keep(2))
    with pytest.raises(ValueError, match="2 seeds for 3"):
        env.reset(seed=[1, 2])
    for arguments, text in (
        ({"fidelity": "toy"}, "kinematic or truck"),
        ({"spec": "theirs"}, "ours or paper"),
        ({"scenario": "table3"}, "no built-in scenario"),
        ({"episode_s": float("nan")}, "episode_s"),
        ({"threads": 0}, "threads = 0"),
    ):
        with pytest.raises(ValueError, match=text):
            envs(**arguments)
    env.close()
    with pytest.raises(ValueError, match="closed"):
        env.reset()


def test_the_papers_environment_and_the_full_truck() -> None:
    env = envs(
        2,
        spec="paper",
        fidelity="truck",
        scenario=["table2-sparse-15", "table2-dense-15"],
    )
    obs, _ = env.reset(seed=3)
    assert obs.shape == (2, 216)
    obs, reward, terminated, _, _ = env.step(keep(2))
    # 14 m/s where 16.67 m/s are wished: a tenth of Eq. 17.
    assert reward == pytest.approx(0.08665, abs=1e-3) and not terminated.any()


def test_gymnasium_makes_and_checks_one() -> None:
    env = gymnasium.make(
        "tractrix/Highway-v0", scenario="table2-sparse-12.5", episode_s=5.0
    )
    check_env(env.unwrapped, skip_render_check=True)
    env.reset(seed=1)
    ended = [env.step(1)[3] for _ in range(5)]
    assert ended == [False] * 4 + [True]


def test_a_change_costs_what_is_asked_in_advantages_too() -> None:
    costs = (0.0, 5.0)
    episodes, worths = [], []
    for cost_s in costs:
        env = tractrix.VectorEnv(
            12, "table2-medium-12.5", 1, episode_s=60.0, change_cost_s=cost_s
        )
        env.reset()
        for _ in range(30):
            env.step(env.wishes("mobil"))
        worths.append(env.advantages("keep", horizon_s=10.0))
        for _ in range(30):
            *_, infos = env.step(env.wishes("mobil"))
        episodes.append(infos["final_info"])
    changes = episodes[0]["lane_changes"]
    paid = episodes[0]["reward_s"] - episodes[1]["reward_s"]
    assert changes.sum() > 3
    np.testing.assert_allclose(paid, 5.0 * changes, atol=1e-9)
    first = (worths[0] - worths[1])[:, [0, 2]]
    assert np.isfinite(first).any()
    np.testing.assert_allclose(first[np.isfinite(first)], 5.0, atol=1e-5)
    with pytest.raises(ValueError, match="change_cost_s = -1"):
        tractrix.VectorEnv(1, change_cost_s=-1.0)
