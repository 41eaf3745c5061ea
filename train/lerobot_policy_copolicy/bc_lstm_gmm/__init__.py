"""BC-LSTM-GMM, robomimic's BC-RNN (Mandlekar et al., 2021, arXiv 2108.03298), as a LeRobot policy."""

from .configuration_bc_lstm_gmm import BcLstmGmmConfig

__all__ = ["BcLstmGmmConfig"]
