#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "access/robot_keys.h"
#include "access/secret_file.h"
#include "base/error.h"
#include "ingest/inbound_message.h"

namespace joulecast::ingest {

struct SignatureOptions {
  std::string key_file;                  // empty: no robot has a key
  bool required = false;                 // of robots without a key, too
  std::int64_t max_age_us = 30'000'000;  // between the time of a signed message and the host's
};

// Passes messages with a proven sender, each once. A robot that has a key may send signed messages only.
// Replays are rejected by their sequence number, with a window for reordered messages (RFC 4303, 3.4.3), and
// by their time. After a start the sequence begins with the first message, so that earlier messages are
// rejected by their time only.
class SignatureGate {
 public:
  explicit SignatureGate(SignatureOptions options) : options_(std::move(options)) {}

  // Fault::invalid where the file holds no keys, or keys are required and there is no file.
  Result<void> read_keys();
  // Reads a file that has changed, looking at most once a second. On an error the keys stay as they were.
  std::optional<Result<void>> refresh();

  // Why the message must not pass.
  std::optional<RefusedMessage> check(std::string_view channel, std::string_view robot_id,
                                      std::span<const std::uint8_t> bytes, std::int64_t host_utime_us);

 private:
  class Window {
   public:
    bool take(std::int64_t sequence);  // false: not new, or older than the window

   private:
    std::int64_t highest_ = INT64_MIN;
    std::uint64_t taken_ = 0;  // bit k: highest_ - k
  };

  SignatureOptions options_;
  access::RobotKeys keys_;
  access::FileStamp stamp_;
  std::chrono::steady_clock::time_point looked_;
  std::map<std::string, std::pair<std::string, Window>, std::less<>> windows_;  // of channels, each of a key
};

}  // namespace joulecast::ingest
