#pragma once

#include <string>
#include <string_view>

namespace joulecast {

// A hint for a text with a NaN or an infinity, which JSON does not have: "; JSON has no NaN: ...". `byte` is
// where the parser stopped, counted from 1. Empty for any other fault.
std::string not_finite_hint(std::string_view text, std::size_t byte);

}  // namespace joulecast
