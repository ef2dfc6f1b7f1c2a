"""`StrictConfig`: the base of every configuration class."""

from pydantic import BaseModel, ConfigDict


class StrictConfig(BaseModel):
    """Frozen settings that refuse unknown fields.

    A config class stands beside what it configures. Field names carry their unit
    (`range_m`, `frame_interval_s`); angles carry `_deg` here, because people write them, and are converted
    once, where they are used.
    """

    model_config = ConfigDict(
        frozen=True, extra="forbid", validate_default=True, use_attribute_docstrings=True
    )
