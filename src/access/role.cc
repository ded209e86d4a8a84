#include "access/role.h"

namespace joulecast::access {

std::string_view name(Role role) {
  switch (role) {
    case Role::open:
      return "open";
    case Role::read:
      return "read";
    case Role::plan:
      return "plan";
    case Role::operate:
      return "operate";
    case Role::admin:
      return "admin";
    case Role::unstated:
      break;
  }
  return "unstated";
}

std::optional<Role> role_of(std::string_view text) {
  for (const Role role : {Role::read, Role::plan, Role::operate, Role::admin})
    if (name(role) == text) return role;
  return std::nullopt;
}

}  // namespace joulecast::access
