#include "base/format_utc.h"

#include <fmt/chrono.h>

#include <chrono>

namespace joulecast {

std::string format_utc(std::int64_t utime_us, std::string_view letters) {
  const auto seconds = std::chrono::floor<std::chrono::seconds>(std::chrono::microseconds(utime_us));
  const std::string form = std::string("{:").append(letters).append("}");
  return fmt::format(fmt::runtime(form), fmt::gmtime(static_cast<std::time_t>(seconds.count())));
}

}  // namespace joulecast
