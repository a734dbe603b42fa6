"""Sequences through an LSTM in one call, in place of one for each of their steps."""

import torch
from sb3_contrib.common.recurrent.policies import RecurrentActorCriticPolicy

States = tuple[torch.Tensor, torch.Tensor]


class FastLstmPolicy(RecurrentActorCriticPolicy):  # type: ignore[misc]
    """The LSTM policy of sb3-contrib, with the same numbers up to rounding.

    The class steps through a sequence one by one if an episode starts anywhere in the sequence. Its
    rollouts are cut at the starts of episodes, so an episode starts at a sequence's first step or
    not at all. A zero state at that step has the same effect.
    """

    @staticmethod
    def _process_sequence(
        features: torch.Tensor,
        lstm_states: States,
        episode_starts: torch.Tensor,
        lstm: torch.nn.LSTM,
    ) -> tuple[torch.Tensor, States]:
        count = lstm_states[0].shape[1]
        starts = episode_starts.reshape(count, -1)
        if starts.shape[1] > 1 and not torch.any(starts[:, 1:]):
            continues = (1.0 - starts[:, 0]).view(1, count, 1)
            lstm_states = (continues * lstm_states[0], continues * lstm_states[1])
            episode_starts = torch.zeros_like(episode_starts)
        result: tuple[torch.Tensor, States] = RecurrentActorCriticPolicy._process_sequence(
            features, lstm_states, episode_starts, lstm
        )
        return result
