"""The processors around BC-LSTM-GMM, found by LeRobot by their name."""

from ..pair_policy.processor_pair import make_pair_pre_post_processors as make_bc_lstm_gmm_pre_post_processors

__all__ = ["make_bc_lstm_gmm_pre_post_processors"]
