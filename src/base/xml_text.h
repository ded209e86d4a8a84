#pragma once

#include <string>
#include <string_view>

namespace joulecast {

// A text as XML or HTML content or attribute value; control characters that are not XML are left out.
[[nodiscard]] std::string xml_escaped(std::string_view text);

}  // namespace joulecast
