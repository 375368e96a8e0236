"""Old names of the seam's modules, for drivers of packages, until a release removes them."""

import sys
import warnings
from importlib import import_module

warnings.warn(
    "protocol_gateway.drivers will be gone: import from protocol_gateway.seam what was in protocol_gateway."
    "drivers.driver, and the modules beside it from there too (docs/controllers/own-driver.md)",
    FutureWarning,
    stacklevel=2,
)
sys.modules[f"{__name__}.driver"] = import_module("protocol_gateway.seam")
for _name in ("hexadecimal", "one_motion", "only_reads", "pendant_text", "polling", "signal_names"):
    sys.modules[f"{__name__}.{_name}"] = import_module(f"protocol_gateway.driver_parts.{_name}")
