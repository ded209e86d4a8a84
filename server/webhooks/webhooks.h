#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "http_client/http_client.h"

namespace joulecast::server {

// A receiver of events by HTTP.
struct Webhook {
  std::string host;                    // with its port: the part of its URL that is no secret
  http_client::ServerAddress address;  // of its URL, path and query included
  std::string secret;                  // key of the signatures
  std::set<std::string> events;        // kinds that it receives
};

// {"webhooks": [{"url": "https://...", "secret_file": "path", "events": ["mission", ...]}]}. A relative
// secret_file is relative to the file's folder; it contains at least 16 bytes, not counting surrounding
// whitespace, and must not be readable by other users. "events" may be left out: all kinds. Faults are on
// "webhooks.file" and contain the JSON pointer.
Result<std::vector<Webhook>> read_webhooks(const std::string& path);

// Every kind that there is, in order of the alphabet: those of the event log and "mission", one that ended.
const std::set<std::string>& event_kinds();

// Sends events to webhooks: POST of
//   {"id", "event", "time", "utime_us", "robot_id", "data"}
// with the header Joulecast-Signature: t=<seconds since 1970>,v1=<HMAC-SHA-256 of "<t>.<body>" by the
// webhook's secret, in hexadecimal>. A delivery that is not answered 2xx is tried again with growing pauses,
// in order; each webhook has a thread and a bounded queue of its own. Events waiting at a stop are lost.
class Webhooks {
 public:
  struct Options {
    std::size_t queue = 1000;  // events that wait for one webhook; beyond: the oldest is dropped
    std::chrono::milliseconds timeout{10'000};
    std::chrono::milliseconds first_pause{1'000};  // doubled each time
    std::chrono::milliseconds last_pause{300'000};
    int attempts = 12;  // about half an hour; then the event is given up
    std::function<std::int64_t()> now_utime_us = {};
    std::function<void(const Error&)> on_error = {};  // the first of a row of failures; any thread
  };
  struct Counts {
    std::uint64_t delivered = 0, failed = 0;  // attempts
    std::uint64_t dropped = 0;                // events that found the queue full
    std::uint64_t given_up = 0;               // events after their last attempt
    std::size_t waiting = 0;
  };

  Webhooks(std::vector<Webhook> webhooks, Options options);
  ~Webhooks();

  // Any thread; never waits. `data` is JSON text; an empty robot_id concerns no single robot.
  void offer(std::string_view kind, std::string_view robot_id, std::int64_t utime_us, std::string_view data);

  // Ends within the time of one attempt.
  void stop();

  struct Status {
    std::string host;  // with its port
    Counts counts;
  };
  // In the order of the file.
  std::vector<Status> status() const;

 private:
  class Sender;
  const Options options_;
  std::vector<std::unique_ptr<Sender>> senders_;
  std::string id_prefix_;
  std::atomic<std::uint64_t> next_id_{1};
};

// The value of the header Joulecast-Signature.
std::string webhook_signature(std::string_view secret, std::int64_t seconds, std::string_view body);

}  // namespace joulecast::server
