#pragma once

#include <boost/locale/utf.hpp>
#include <string_view>

namespace joulecast {

// Well-formed UTF-8 (RFC 3629: no overlong forms, no surrogates, nothing over U+10FFFF).
[[nodiscard]] inline bool is_utf8(std::string_view text) noexcept {
  using namespace boost::locale::utf;
  for (auto at = text.begin(); at != text.end();)
    if (!is_valid_codepoint(utf_traits<char>::decode(at, text.end()))) return false;
  return true;
}

}  // namespace joulecast
