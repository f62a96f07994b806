"""Tenants, their API keys, quotas, and the audit log."""

from marey.tenants.audit import audit, list_audit
from marey.tenants.keys import (
    SCOPES,
    authenticate,
    check_key,
    create_key,
    keys_named,
    keys_still_valid,
    list_keys,
    revoke_key,
    rotate_key,
)
from marey.tenants.quotas import check_quotas, usage
from marey.tenants.repository import (
    create_tenant,
    get_tenant,
    list_tenants,
    reinstate_tenant,
    set_quotas,
    suspend_tenant,
)
from marey.tenants.types import (
    DEFAULT_TENANT,
    Actor,
    ApiKey,
    AuditRow,
    NewApiKey,
    QuotaHeadroom,
    Quotas,
    TenantRow,
    Usage,
)

__all__ = [
    "DEFAULT_TENANT",
    "SCOPES",
    "Actor",
    "ApiKey",
    "AuditRow",
    "NewApiKey",
    "QuotaHeadroom",
    "Quotas",
    "TenantRow",
    "Usage",
    "audit",
    "authenticate",
    "check_key",
    "check_quotas",
    "create_key",
    "create_tenant",
    "get_tenant",
    "keys_named",
    "keys_still_valid",
    "list_audit",
    "list_keys",
    "list_tenants",
    "reinstate_tenant",
    "revoke_key",
    "rotate_key",
    "set_quotas",
    "suspend_tenant",
    "usage",
]
