#include "client/commands/accepts.h"

#include <fmt/format.h>

#include <algorithm>

namespace joulecast::client {
namespace {

template <class Accepts>
CLI::Validator number(const std::string& bounds, Accepts accepts) {
  return {[bounds, accepts](std::string& text) -> std::string {
            double value = 0;
            if (CLI::detail::lexical_cast(text, value) && accepts(value)) return {};
            return fmt::format("must be {}, not {}", bounds, text);
          },
          bounds};
}

}  // namespace

CLI::Validator one_of(const std::vector<std::string>& words) {
  const std::string set = fmt::format("{{{}}}", fmt::join(words, ","));
  return {[words, set](std::string& text) -> std::string {
            if (std::ranges::find(words, text) != words.end()) return {};
            return fmt::format("must be one of {}, not {}", set, text);
          },
          set};
}

CLI::Validator between(double least, double most) {
  return number(fmt::format("{:.12g} to {:.12g}", least, most),
                [least, most](double value) { return value >= least && value <= most; });
}

CLI::Validator positive() {
  return number("above 0", [](double value) { return value > 0; });
}

CLI::Validator not_negative() {
  return number("at least 0", [](double value) { return value >= 0; });
}

}  // namespace joulecast::client
