#include "server/http/text.h"

#include <optional>

namespace joulecast::http {
namespace {

bool is_digit(char c) {
  return c >= '0' && c <= '9';
}

// Adds one to the last digit of [begin, end), a decimal with at most one point; true: the first one carries.
bool carry(char* begin, char* end) {
  for (char* at = end; at != begin;) {
    --at;
    if (*at == '.') continue;
    if (*at != '9') {
      ++*at;
      return false;
    }
    *at = '0';
  }
  return true;
}

// Writes the rounded form of [from, end) to `to`, which is at or before it, and returns its end.
char* round_token(const char* from, const char* end, char* to, int digits) {
  const char* exponent = std::find_if(from, end, [](char c) { return c == 'e' || c == 'E'; });
  const char* point = std::find(from, exponent, '.');
  const auto copy_all = [&] { return std::copy(from, end, to); };
  if (end - from <= digits || point == exponent) return copy_all();
  const char* first = std::find_if(from, exponent, [](char c) { return c >= '1' && c <= '9'; });
  // The first digit that is left out; none before the point is.
  int seen = 0;
  const char* cut = first;
  for (; cut != exponent && (seen < digits || cut < point); ++cut) seen += is_digit(*cut) ? 1 : 0;
  if (cut != exponent && *cut == '.') ++cut;
  if (cut == exponent) return copy_all();
  const bool up = *cut >= '5';
  char* digits_begin = *from == '-' ? to + 1 : to;
  char* written = std::copy(from, cut, to);
  if (up && carry(digits_begin, written)) {
    std::copy_backward(digits_begin, written, written + 1);
    *digits_begin = '1';
    ++written;
  }
  while (written[-1] == '0') --written;
  if (written[-1] == '.') --written;
  return std::copy(exponent, end, written);
}

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

std::string rounded(std::string json, int digits) {
  const char* at = json.data();
  const char* const end = at + json.size();
  char* to = json.data();
  while (at != end) {
    if (*at == '"') {
      const char* close = at + 1;
      while (close != end && *close != '"') close += *close == '\\' && close + 1 != end ? 2 : 1;
      if (close != end) ++close;
      to = std::copy(at, close, to);
      at = close;
    } else if (is_digit(*at) || *at == '-') {
      const char* stop = std::find_if_not(at, end, [](char c) {
        return is_digit(c) || c == '.' || c == '-' || c == '+' || c == 'e' || c == 'E';
      });
      to = round_token(at, stop, to, digits);
      at = stop;
    } else {
      *to++ = *at++;
    }
  }
  json.resize(static_cast<std::size_t>(to - json.data()));
  return json;
}

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
