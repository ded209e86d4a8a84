#pragma once

#include <string>
#include <string_view>

namespace joulecast {

// What to write instead where a parser stopped at `byte` (counted from 1, where it noticed) of a text that
// holds a NaN or an infinity, which JSON has not: "; JSON has no NaN: ...". Nothing for any other fault.
std::string not_finite_hint(std::string_view text, std::size_t byte);

}  // namespace joulecast
