"""Mutual TLS between a client and its router, with a test authority's certificates."""

from pathlib import Path

import pytest
import trustme
import zenoh

from robomesh.contract.endpoints import Tls, router_config
from robomesh.errors import SessionError
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import SessionSettings, open_session
from tests.conftest import last_value
from tests.ports import free_port


def certificates(authority: trustme.CA, folder: Path, name: str) -> Tls:
    issued = authority.issue_cert("127.0.0.1", "localhost", common_name=name)
    tls = Tls(ca=folder / "ca.pem", certificate=folder / f"{name}.pem", key=folder / f"{name}.key")
    authority.cert_pem.write_to_path(str(tls.ca))
    tls.certificate.write_bytes(b"".join(part.bytes() for part in issued.cert_chain_pems))
    issued.private_key_pem.write_to_path(str(tls.key))
    return tls


async def test_router_accepts_only_certificates_of_its_authority(tmp_path):
    authority = trustme.CA()
    endpoint = f"tls/127.0.0.1:{free_port()}"
    strangers = tmp_path / "strangers"
    strangers.mkdir()
    with zenoh.open(router_config((endpoint,), tls=certificates(authority, tmp_path, "router"))):
        settings = SessionSettings(
            connect=(endpoint,), tls=certificates(authority, tmp_path, "gateway"), wait_s=5.0
        )
        async with open_session(settings) as one, open_session(settings) as other:
            publisher = one.declare_publisher("site", "arm", "description")
            publisher.put(schema.Description(name="pt600"))
            message = await last_value(other, "robomesh/site/arm/description")
            assert message.name == "pt600"
        stranger = certificates(trustme.CA(), strangers, "stranger")
        for tls, why in ((None, "it needs one"), (stranger, "did not sign")):
            with pytest.raises(SessionError, match=why):
                async with open_session(SessionSettings(connect=(endpoint,), tls=tls, wait_s=0.0)):
                    pass
