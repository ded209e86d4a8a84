#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <memory>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"

// The event log of lcm-logger: a run of events, each big-endian
//   u32 sync 0xEDA1DA01 | i64 number | i64 timestamp [us] | i32 channel length | i32 data length | channel |
//   data
// LCM's own reader also returns "no more events" for a damaged file; this one distinguishes the two.
namespace joulecast::telemetry {

inline constexpr std::uint32_t log_sync_word = 0xEDA1DA01;
inline constexpr std::size_t log_header_size = 28;

struct LogLimits {
  std::size_t max_channel_length = 63;      // LCM's own limit
  std::size_t max_data_length = 16u << 20;  // far above any message of the contract
  std::size_t read_size = 1u << 20;         // bytes requested from the source at a time
};

struct LogEvent {
  std::int64_t number = 0;
  std::int64_t timestamp_us = 0;       // when the logger received it, host clock
  std::string_view channel;            // valid until the reader moves on
  std::span<const std::uint8_t> data;  // likewise
};

using LogObserver = std::function<void(const LogEvent&)>;

enum class LogStatus {
  event,      // an event was read
  end,        // the file ends exactly after its last event
  truncated,  // the file ends inside an event, which begins at `offset`
  corrupt,    // no event can begin at `offset`; resync() may find the next
  failed      // the file cannot be read (I/O error)
};

struct LogRead {
  LogStatus status = LogStatus::end;
  LogEvent event;            // when status is event
  std::uint64_t offset = 0;  // byte offset of the event, of the damage, or of the end
  std::string message;       // the error, for truncated, corrupt and failed
};

class EventLogReader {
 public:
  // Fills the span from the front and returns how many bytes it wrote; 0 at the end, negative on failure.
  using Source = std::function<std::ptrdiff_t(std::span<std::uint8_t>)>;

  static Result<EventLogReader> open(const std::string& path, LogLimits limits = {});
  explicit EventLogReader(Source source, LogLimits limits = {});

  // The next event, or the reason why no event follows. A damaged place is reported again until resync().
  LogRead next();

  // Move to the next sync word after the present place that begins a whole, plausible event which another
  // sync word or the end follows, or to the end if no such event follows. Returns the bytes skipped.
  std::uint64_t resync();

  [[nodiscard]] std::uint64_t skipped_bytes() const noexcept { return skipped_; }

 private:
  // Bytes from the present place on, at least `wanted` of them unless the source ends first.
  std::span<const std::uint8_t> peek(std::size_t wanted);
  void advance(std::size_t count) noexcept;
  // A plausible, whole event is here, and another sync word or the end follows it.
  [[nodiscard]] bool begins_event();

  Source source_;
  LogLimits limits_;
  std::vector<std::uint8_t> buffer_;
  std::size_t begin_ = 0;  // the present place in buffer_
  std::size_t filled_ = 0;
  std::uint64_t offset_ = 0;  // of begin_ in the file
  std::size_t pending_ = 0;   // length of the event handed out last, consumed by the next call
  std::uint64_t skipped_ = 0;
  bool exhausted_ = false;
  bool failed_ = false;
};

// Statistics of reading a whole log.
struct LogTally {
  std::uint64_t events = 0;
  std::uint64_t damaged_places = 0;
  std::uint64_t skipped_bytes = 0;
  std::uint64_t of_robots = 0;                        // events on channels of the contract
  std::set<std::string, std::less<>> other_channels;  // the first ones
};

// Passes every event of a log to `take` until it returns false; reports damaged places to `damaged` and skips
// them. Adds to `tally`. Returns whether the log was read to its end; errors: of `take`, opening and reading.
Result<bool> read_events(const std::string& path, const std::function<Result<bool>(const LogEvent&)>& take,
                         LogTally& tally, const std::function<void(const LogRead&)>& damaged = {});

// Writes logs in lcm-logger's format; numbers count from 0.
class EventLogWriter {
 public:
  static Result<EventLogWriter> create(const std::string& path);

  Result<void> write(std::int64_t timestamp_us, std::string_view channel, std::span<const std::uint8_t> data);
  // Flushes, closes, and returns whether every byte reached the system. The destructor only closes.
  Result<void> close();

  [[nodiscard]] std::int64_t count() const noexcept { return count_; }

 private:
  struct FileCloser {
    void operator()(std::FILE* file) const noexcept { std::fclose(file); }
  };

  EventLogWriter(std::FILE* file, std::string path) : file_(file), path_(std::move(path)) {}

  std::unique_ptr<std::FILE, FileCloser> file_;
  std::string path_;
  std::int64_t count_ = 0;
};

}  // namespace joulecast::telemetry
