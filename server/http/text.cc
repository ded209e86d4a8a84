#include "server/http/text.h"

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

}  // namespace

void round_numbers(std::string& json, int digits) {
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
}

std::string rounded_number(std::string_view number, int digits) {
  std::string text(number);
  round_numbers(text, digits);
  return text;
}

}  // namespace joulecast::http
