#include "access/role.h"

namespace joulecast::access {

std::string_view name(Role role) {
  constexpr std::string_view names[] = {"open", "read", "plan", "operate", "admin", "unstated"};
  return names[static_cast<std::size_t>(role)];
}

std::optional<Role> role_of(std::string_view text) {
  for (const Role role : {Role::read, Role::plan, Role::operate, Role::admin})
    if (name(role) == text) return role;
  return std::nullopt;
}

}  // namespace joulecast::access
