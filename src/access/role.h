#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace joulecast::access {

// Permissions of a token, ascending: each role includes those before it. `open` needs no token; no token has
// the role `unstated`, so a request that states no role is rejected.
enum class Role : std::uint8_t { open, read, plan, operate, admin, unstated };

std::string_view name(Role role);

// One of the four roles that a token can have.
std::optional<Role> role_of(std::string_view name);

}  // namespace joulecast::access
