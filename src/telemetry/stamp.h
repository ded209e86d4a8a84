#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "base/error.h"

namespace joulecast::telemetry {

// Reads time stamps of loggers, in microseconds since 1970: ISO 8601 and its usual variants (blank or T, any
// signs between the numbers, compact, `+00`, ` UTC`, ` CET`), names of months, 12-hour clocks, and day or
// month first where only one of the two is a date or points divide them. Times of day without a date are
// since midnight of the first one's day. Not thread-safe.
class StampReader {
 public:
  // `zone`: of stamps that name none, "Z", an offset like "+01:00" or an IANA name like "Europe/Berlin";
  // empty: such stamps are errors. `format`: strptime's letters instead of the usual forms; empty: the usual
  // forms. Errors: an unknown zone.
  static Result<StampReader> create(const std::string& zone, const std::string& format = {});

  // In an hour that a zone's clock repeats, the time nearest to the stamp read before; without one, the
  // first. Digits behind microseconds are cut off. Errors have no field and begin with "is no time".
  Result<std::int64_t> read(std::string_view text);

 private:
  struct Zone;
  std::shared_ptr<const Zone> zone_;  // null: none
  [[nodiscard]] std::int64_t of_next_day(std::int64_t since_midnight_us) const;

  std::string format_;
  std::optional<std::int64_t> last_utime_us_;
};

}  // namespace joulecast::telemetry
