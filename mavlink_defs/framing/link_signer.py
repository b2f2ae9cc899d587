"""Compiled signers of links that use a key file."""

import time

from mavlink_defs.framing.hot_signing import LinkSigner, new_link_signer, use_keys
from mavlink_defs.framing.key_file import KeyFile
from mavlink_defs.framing.signing import open_time


def load_link_signer(key_file: KeyFile | None, link: int) -> LinkSigner:
    """Return the compiled signer of a link; without a file, one that neither signs nor verifies.

    Raises:
        SigningError: The time of the last signature cannot be kept.
    """
    if key_file is None:
        return new_link_signer(b"", link)
    signer = new_link_signer(key_file.at(time.time()), link, open_time(key_file.path))
    return signer._replace(start=key_file.begin)


def refresh(key_file: KeyFile, *link_signers: LinkSigner) -> None:
    """Let compiled signers use the keys that a file holds now."""
    for link_signer in link_signers:
        use_keys(link_signer, key_file.at(time.time()))
