#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace joulecast::access {

// What a token may do, ascending: each role may do all that the ones before it may. `open` needs no token;
// `unstated` is held by nobody, so what states no role is refused to everyone.
enum class Role : std::uint8_t { open, read, plan, operate, admin, unstated };

std::string_view name(Role role);

// One of the four roles that a token can have.
std::optional<Role> role_of(std::string_view name);

}  // namespace joulecast::access
