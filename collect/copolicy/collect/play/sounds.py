"""Short tones for count-down, start, goal, collision and time-out, synthesized from sines."""

import numpy as np

from copolicy.dataset.arrays import Array

from ..sdl import pygame

_RATE = 22050
_TONES: dict[str, tuple[tuple[float, float], ...]] = {  # sequences of (Hz, s)
    "count": ((520.0, 0.09),),
    "go": ((780.0, 0.22),),
    "goal": ((523.0, 0.11), (659.0, 0.11), (784.0, 0.11), (1047.0, 0.28)),
    "collision": ((196.0, 0.16), (131.0, 0.34)),
    "timeout": ((392.0, 0.18), (330.0, 0.18), (262.0, 0.3)),
    "choose": ((660.0, 0.05),),
    "alarm": ((440.0, 0.12), (330.0, 0.2)),
}


class Sounds:
    """Plays tones if there is an audio device; silent otherwise.

    Attributes:
        mute: play no tones.
    """

    def __init__(self, mute: bool):
        self.mute = mute
        self._sounds: dict[str, pygame.mixer.Sound] = {}
        if mute:
            return
        try:
            pygame.mixer.init(_RATE, -16, 1, 512)
            _, _, channels = pygame.mixer.get_init()
        except pygame.error:
            return  # no audio device; the screen shows everything that the tones signal
        for name, tones in _TONES.items():
            wave = np.concatenate([_tone(frequency, seconds) for frequency, seconds in tones])
            self._sounds[name] = pygame.mixer.Sound(buffer=np.repeat(wave, channels).tobytes())

    def play(self, name: str) -> None:
        """Plays a tone, unless muted."""
        if not self.mute and name in self._sounds:
            self._sounds[name].play()

    def close(self) -> None:
        """Closes the audio device."""
        if pygame.mixer.get_init():
            pygame.mixer.quit()


def _tone(frequency: float, seconds: float) -> Array:
    time = np.arange(int(_RATE * seconds)) / _RATE
    wave = np.sin(2 * np.pi * frequency * time) + 0.25 * np.sin(4 * np.pi * frequency * time)
    envelope = np.minimum(1.0, np.minimum(time, seconds - time) / 0.012)  # avoids a click at both ends
    return (0.22 * 32767 * envelope * wave).astype(np.int16)
