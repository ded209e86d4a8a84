#include "server/http/uri.h"

#include <algorithm>
#include <charconv>
#include <cstddef>

#include "base/text.h"
#include "server/http/text.h"

namespace joulecast::http {
namespace {

constexpr const char* unreadable = "malformed percent-encoding or text that is not printable UTF-8";

// Decodes %XX; with `plus_is_space` also '+'. Fails on truncated or non-hexadecimal escapes, on NUL and
// control characters and on text that is not UTF-8.
std::optional<std::string> percent_decode(std::string_view text, bool plus_is_space) {
  std::string decoded;
  decoded.reserve(text.size());
  for (std::size_t i = 0; i < text.size(); ++i) {
    char c = text[i];
    if (c == '%') {
      unsigned char code = 0;
      const char* const digits = text.data() + i + 1;
      if (text.size() - i < 3 || std::from_chars(digits, digits + 2, code, 16).ptr != digits + 2)
        return std::nullopt;
      c = static_cast<char>(code);
      i += 2;
    } else if (c == '+' && plus_is_space) {
      c = ' ';
    }
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7F) return std::nullopt;
    decoded.push_back(c);
  }
  if (!is_utf8(decoded)) return std::nullopt;
  return decoded;
}

}  // namespace

Result<Target> parse_target(std::string_view target) {
  for (const std::string_view scheme : {"http://", "https://"}) {
    if (target.starts_with(scheme)) {
      target.remove_prefix(scheme.size());
      const auto slash = target.find_first_of("/?");
      target = slash == std::string_view::npos ? std::string_view("/") : target.substr(slash);
      break;
    }
  }
  if (target.find('#') != std::string_view::npos)
    return invalid("target", "a fragment is not part of a request");
  const auto question = target.find('?');
  std::string_view path = target.substr(0, question);
  if (path.empty() || path.front() != '/') return invalid("target", "the path must start with '/'");

  Target parsed;
  path.remove_prefix(1);
  for (;;) {
    const auto slash = path.find('/');
    auto segment = percent_decode(path.substr(0, slash), false);
    if (!segment) return invalid("path", unreadable);
    parsed.segments.push_back(std::move(*segment));
    if (slash == std::string_view::npos) break;
    path.remove_prefix(slash + 1);
  }

  if (question == std::string_view::npos) return parsed;
  std::string_view query = target.substr(question + 1);
  while (!query.empty()) {
    std::string_view pair = take_item(query, '&');
    if (pair.empty()) continue;
    auto key = percent_decode(take_item(pair, '='), true);
    if (!key) return invalid("query", unreadable);
    auto value = percent_decode(pair, true);
    if (!value) return invalid(*key, unreadable);
    if (std::ranges::any_of(parsed.query, [&](const auto& seen) { return seen.first == *key; }))
      return invalid(*key, "the query key is given more than once");
    parsed.query.emplace_back(std::move(*key), std::move(*value));
  }
  return parsed;
}

}  // namespace joulecast::http
