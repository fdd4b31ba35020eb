"""A window that shows pictures at their pace."""

from typing import final

import numpy as np

from symoden.drawing import Picture

try:
    import pygame
except ModuleNotFoundError as error:
    raise ModuleNotFoundError('A window needs pygame. Install "symoden[gym]".') from error


@final
class Window:
    """Window on the screen; it opens with the first picture.

    Attributes:
        title: Its title.
        rate: Pictures a second.
    """

    def __init__(self, title: str, rate: int) -> None:
        self.title, self.rate = title, rate
        self._screen: pygame.Surface | None = None
        self._clock = pygame.time.Clock()

    def show(self, picture: Picture) -> None:
        """Show a picture, and wait until it is time for the next one.

        Args:
            picture: The picture.
        """
        if self._screen is None:
            pygame.display.init()
            pygame.display.set_caption(self.title)
            self._screen = pygame.display.set_mode((picture.shape[1], picture.shape[0]))
        self._screen.blit(pygame.surfarray.make_surface(np.swapaxes(picture, 0, 1)), (0, 0))
        pygame.event.pump()
        pygame.display.flip()
        self._clock.tick(self.rate)

    def close(self) -> None:
        """Close the window, if it is open."""
        if self._screen is not None:
            pygame.display.quit()
            self._screen = None
