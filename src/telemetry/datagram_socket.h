#pragma once

#include <netinet/in.h>
#include <sys/socket.h>

#include <array>
#include <boost/core/noncopyable.hpp>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "telemetry/datagram.h"

namespace joulecast::telemetry {

struct UdpmUrl {
  std::uint32_t group = 0;  // host byte order
  std::uint16_t port = 0;
  int receive_buffer_bytes = 0;  // 0: the system's usual
};

// "udpm://239.255.76.67:7667?ttl=0&recv_buf_size=4194304"; group and port may be left out. ttl is the
// sender's and only checked here.
[[nodiscard]] Result<UdpmUrl> parse_udpm_url(std::string_view url);

// The IPv4 address of an interface in host byte order; of an empty text, any.
[[nodiscard]] Result<std::uint32_t> parse_interface(const std::string& text);

// The addresses that may send messages.
class AcceptedSenders {
 public:
  // Networks separated by commas: "10.1.0.0/16", "192.168.1.7", "any", "local" for loopback and the networks
  // of this host's interfaces, which are read again when a sender is unknown.
  static Result<AcceptedSenders> parse(std::string_view list);

  // `now_us` of any clock that does not go back.
  bool accepts(std::uint32_t address, std::int64_t now_us);

 private:
  struct Network {
    std::uint32_t address = 0, mask = 0;
  };
  bool contains(std::uint32_t address) const;
  void read_interfaces();

  std::vector<Network> networks_, interfaces_;
  bool local_ = false;
  std::int64_t read_us_ = 0;
};

// Receives the robots' messages of one multicast group. Bound to the group's address, so that unicast and
// other groups of the port do not come in.
class DatagramSocket : boost::noncopyable {
 public:
  // The views end with the call.
  using Handler = std::function<void(const Sender&, const ChannelMessage&, std::int64_t recv_utime_us)>;

  // `interface_address`: IPv4 of the interface to listen on; empty: the one that the system routes the group
  // to. Errors name the setting that is at fault.
  static Result<std::unique_ptr<DatagramSocket>> open(const UdpmUrl& url,
                                                      const std::string& interface_address,
                                                      AcceptedSenders accepted, DatagramCounters& counters);
  ~DatagramSocket();

  int descriptor() const noexcept { return descriptor_; }

  // Handles the datagrams that wait, `max_datagrams` at most, and returns their number. Does not wait.
  Result<int> receive(int max_datagrams, const Handler& handler);

 private:
  static constexpr std::size_t batch = 64;

  DatagramSocket(AcceptedSenders accepted, DatagramCounters& counters);
  void count_dropped(const msghdr& header);

  AcceptedSenders accepted_;
  DatagramCounters& counters_;
  DatagramReader reader_;
  std::vector<std::uint8_t> bytes_;
  std::array<iovec, batch> parts_{};
  std::array<mmsghdr, batch> messages_{};
  std::array<sockaddr_in, batch> senders_{};
  std::array<std::array<std::uint64_t, 8>, batch> controls_{};
  std::uint32_t dropped_ = 0;
  int descriptor_ = -1;
};

}  // namespace joulecast::telemetry
