#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "base/error.h"
#include "telemetry/datagram.h"

namespace joulecast::telemetry {

// The default group and port of LCM programs; ttl=0 keeps the sent messages on this machine. The kernel's
// default receive buffer stores some 30 ms of 6,000 messages a second, less than a busy machine may delay the
// receiver, and drops the rest without notice; 4 MiB store more than a second of them, where
// net.core.rmem_max allows that size.
inline constexpr std::string_view default_lcm_url = "udpm://239.255.76.67:7667?ttl=0&recv_buf_size=4194304";

// A fault of an LCM URL that is visible without opening it.
Result<void> check_lcm_url(const std::string& provider_url);

struct Received {
  std::string_view channel;
  std::span<const std::uint8_t> data;
  // Host clock when it was received, or when a file's event was due.
  std::int64_t recv_utime_us = 0;
  Sender sender = {};
};

// The accepted senders, of UDP: see datagram_socket.h.
struct ListenOptions {
  std::string interface_address;
  std::string accept_from = "local";
};

// One LCM instance: raw bytes in and out. The views handed to a handler are valid during the call only. Not
// thread-safe but for wake() and publish(), which any thread may call.
//
// Providers: "udpm://239.255.76.67:7667?ttl=0" (network), "memq://" (this instance alone, for tests),
// "file:///path/to.log?speed=0" (a log's events as if received; 0 = as fast as they are read),
// "tcpq://host:port". UDP is received by DatagramSocket, which validates datagrams; liblcm 1.3.1 writes
// beyond its buffer if a fragment declares a place there. All else is liblcm's. LCM has no authentication:
// any sender that reaches the segment and is accepted by ListenOptions may publish.
class LcmLink {
 public:
  using Handler = std::function<void(const Received&)>;

  static Result<LcmLink> open(const std::string& provider_url);
  LcmLink(LcmLink&&) noexcept;
  LcmLink& operator=(LcmLink&&) noexcept;
  ~LcmLink();

  // Receives the messages of the channels that robots publish on, until the link goes; once a link.
  // `counters` of the datagrams that came by UDP, and must outlive the link. Errors name the setting.
  Result<void> listen(Handler handler, DatagramCounters& counters, const ListenOptions& options = {});

  Result<void> publish(const std::string& channel, std::span<const std::uint8_t> data);

  // Wait at most `timeout` for messages, then handle all that are waiting, `max_messages` at most. Returns
  // the number handled (of UDP that of datagrams); 0 after a timeout or wake(). An exception of a handler
  // leaves through here, after LCM has returned. Fault::unavailable when the provider ended: the end of a
  // file, or a broken socket.
  Result<int> poll(std::chrono::milliseconds timeout, int max_messages = 1'000);

  // Make a waiting poll (or the next one) return immediately.
  void wake() noexcept;

 private:
  struct State;
  explicit LcmLink(std::unique_ptr<State> state) noexcept;
  std::unique_ptr<State> state_;
};

}  // namespace joulecast::telemetry
