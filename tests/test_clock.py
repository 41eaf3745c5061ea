import numpy as np
import pytest

from copolicy.dataset import clock
from copolicy.dataset.exceptions import InvalidValueError

ACTIONS = np.arange(28, dtype=float).reshape(7, 4)


def test_stride_divides_the_recording_rate():
    assert [clock.stride(fps) for fps in (30, 15, 10, 5, 1)] == [1, 2, 3, 6, 30]


@pytest.mark.parametrize("fps", [0, 7, 20, 60])
def test_a_rate_that_does_not_divide_is_refused(fps):
    with pytest.raises(InvalidValueError) as error:
        clock.stride(fps)
    assert str(error.value) == f"fps: expected a divisor of 30 [1, 2, 3, 5, 6, 10, 15, 30], found {fps}"


def test_the_action_of_a_frame_is_the_mean_of_its_steps_and_of_what_is_left_at_the_end():
    frames = clock.frame_actions(ACTIONS, 10)
    np.testing.assert_allclose(frames, [ACTIONS[:3].mean(0), ACTIONS[3:6].mean(0), ACTIONS[6]])


def test_the_first_action_can_be_held_instead():
    np.testing.assert_array_equal(clock.frame_actions(ACTIONS, 10, "first"), ACTIONS[::3])


def test_an_unknown_downsampling_is_refused():
    with pytest.raises(InvalidValueError, match="downsampling: expected one of"):
        clock.frame_actions(ACTIONS, 10, "median")  # pyright: ignore[reportArgumentType]


def test_previous_actions_start_with_zero():
    np.testing.assert_array_equal(clock.previous_actions(ACTIONS), np.vstack((np.zeros(4), ACTIONS[:-1])))


def test_frames_are_as_many_as_their_actions():
    for steps in range(1, 12):
        states, actions = np.zeros((steps, 7)), np.zeros((steps, 4))
        for fps in (30, 15, 10):
            assert len(clock.frame_states(states, fps)) == len(clock.frame_actions(actions, fps))


def test_zero_order_hold_repeats_each_action():
    np.testing.assert_array_equal(clock.zero_order_hold(ACTIONS[:2], 10), ACTIONS[[0, 0, 0, 1, 1, 1]])
