"""The first schema: missions, events, presets, audit, logins."""

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None


def upgrade() -> None:
    op.create_table(
        "mission",
        sa.Column("id", sa.String(64), primary_key=True),
        sa.Column("scene", sa.String(200), nullable=False),
        sa.Column("scene_source", sa.String(), nullable=False),
        sa.Column("preset", sa.String(100), nullable=False),
        sa.Column("preset_source", sa.String(100), nullable=False),
        sa.Column("seed", sa.Integer(), nullable=False),
        sa.Column("max_time_s", sa.Float()),
        sa.Column("clock", sa.String(16)),
        sa.Column("overrides", sa.JSON(), nullable=False),
        sa.Column("idempotency_key", sa.String(200)),
        sa.Column("request_digest", sa.String(64)),
        sa.Column("created_by", sa.String(100), nullable=False),
        sa.Column("created_at", sa.Float(), nullable=False),
        sa.Column("queued_at", sa.Float()),
        sa.Column("started_at", sa.Float()),
        sa.Column("ended_at", sa.Float()),
        sa.Column("state", sa.String(16), nullable=False),
        sa.Column("reason", sa.String(), nullable=False),
        sa.Column("stop_reason", sa.String(50)),
        sa.Column("view_sequence", sa.Integer(), nullable=False),
        sa.UniqueConstraint("idempotency_key", name="mission_idempotency_key"),
    )
    op.create_index("ix_mission_created_at", "mission", ["created_at"])
    op.create_index("ix_mission_state", "mission", ["state"])
    op.create_table(
        "event",
        sa.Column(
            "mission_id", sa.String(64), sa.ForeignKey("mission.id", ondelete="CASCADE"), primary_key=True
        ),
        sa.Column("sequence", sa.Integer(), primary_key=True, autoincrement=False),
        sa.Column("kind", sa.String(50), nullable=False),
        sa.Column("content", sa.JSON(), nullable=False),
    )
    op.create_table(
        "preset",
        sa.Column("name", sa.String(100), primary_key=True),
        sa.Column("base", sa.String(100), nullable=False),
        sa.Column("description", sa.String(500), nullable=False),
        sa.Column("overrides", sa.JSON(), nullable=False),
        sa.Column("saved_by", sa.String(100), nullable=False),
        sa.Column("saved_at", sa.Float(), nullable=False),
    )
    op.create_table(
        "audit",
        sa.Column("id", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), primary_key=True),
        sa.Column("at", sa.Float(), nullable=False),
        sa.Column("actor", sa.String(100), nullable=False),
        sa.Column("role", sa.String(16), nullable=False),
        sa.Column("address", sa.String(64), nullable=False),
        sa.Column("method", sa.String(16), nullable=False),
        sa.Column("path", sa.String(300), nullable=False),
        sa.Column("status", sa.Integer(), nullable=False),
    )
    op.create_index("ix_audit_at", "audit", ["at"])
    op.create_table(
        "login",
        sa.Column("secret_digest", sa.String(64), primary_key=True),
        sa.Column("token_digest", sa.String(64), nullable=False),
        sa.Column("opened_at", sa.Float(), nullable=False),
        sa.Column("expires_at", sa.Float(), nullable=False),
    )
