#include "telemetry/datagram_socket.h"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <optional>
#include <utility>

#include "base/host_clock.h"
#include "base/text.h"
#include "base/try.h"

namespace joulecast::telemetry {
namespace {

constexpr std::size_t datagram_bytes = 64 * 1024;  // UDP over IPv4 carries 65,507
constexpr std::int64_t interfaces_age_us = 5'000'000;

std::int64_t monotonic_us() {
  using namespace std::chrono;
  return duration_cast<microseconds>(steady_clock::now().time_since_epoch()).count();
}

std::optional<std::uint32_t> parse_address(std::string_view text) {
  in_addr address{};
  if (::inet_pton(AF_INET, std::string(text).c_str(), &address) != 1) return std::nullopt;
  return ntohl(address.s_addr);
}

Result<void> read_option(UdpmUrl& parsed, std::string_view option) {
  const std::string_view name = take_item(option, '=');
  const std::optional<int> value = to_number<int>(option);
  if (name == "ttl") {
    if (!value || *value < 0 || *value > 255)
      return invalid("lcm.url", "ttl must be an integer from 0 to 255");
  } else if (name == "recv_buf_size") {
    if (!value || *value < 1) return invalid("lcm.url", "recv_buf_size must be a positive integer");
    parsed.receive_buffer_bytes = *value;
  } else {
    return invalid("lcm.url", "has no option '" + std::string(name) + "'; ttl and recv_buf_size there are");
  }
  return {};
}

}  // namespace

Result<UdpmUrl> parse_udpm_url(std::string_view url) {
  constexpr std::string_view scheme = "udpm://";
  if (!url.starts_with(scheme)) return invalid("lcm.url", "must begin with udpm://");
  std::string_view options = url.substr(scheme.size());
  std::string_view network = take_item(options, '?');
  const std::string_view host = take_item(network, ':');
  UdpmUrl parsed{0xefff4c43, 7667, 0};  // 239.255.76.67
  if (!host.empty()) {
    const auto group = parse_address(host);
    if (!group || *group >> 28 != 0xe)
      return invalid("lcm.url", "'" + std::string(host) +
                                    "' is no IPv4 multicast address (224.0.0.0 to 239.255.255.255)");
    parsed.group = *group;
  }
  if (!network.empty()) {
    const auto port = to_number<std::uint16_t>(network);
    if (!port || *port == 0)
      return invalid("lcm.url", "'" + std::string(network) + "' is no port (1 to 65535)");
    parsed.port = *port;
  }
  while (!options.empty()) TRY(read_option(parsed, take_item(options, '&')));
  return parsed;
}

Result<std::uint32_t> parse_interface(const std::string& text) {
  const auto address = parse_address(text.empty() ? "0.0.0.0" : text);
  if (!address) return invalid("lcm.bind_address", "'" + text + "' is no IPv4 address");
  return *address;
}

Result<AcceptedSenders> AcceptedSenders::parse(std::string_view list) {
  AcceptedSenders accepted;
  while (!list.empty()) {
    std::string_view entry = trimmed(take_item(list, ','));
    if (entry == "local") {
      accepted.local_ = true;
      continue;
    }
    if (entry == "any") {
      accepted.networks_.push_back({});
      continue;
    }
    const std::string whole(entry);
    const std::optional<std::uint32_t> address = parse_address(take_item(entry, '/'));
    const std::optional<int> bits =
        entry.empty() ? (whole.ends_with('/') ? std::nullopt : std::optional(32)) : to_number<int>(entry);
    if (!address || !bits || *bits < 0 || *bits > 32)
      return invalid(
          "lcm.accept_from",
          "'" + whole + "' is neither an IPv4 address, a network such as 10.1.0.0/16, any nor local");
    const std::uint32_t mask = *bits == 0 ? 0 : ~std::uint32_t{0} << (32 - *bits);
    accepted.networks_.push_back({*address & mask, mask});
  }
  if (!accepted.local_ && accepted.networks_.empty()) return invalid("lcm.accept_from", "names no sender");
  return accepted;
}

bool AcceptedSenders::contains(std::uint32_t address) const {
  const auto holds = [&](const Network& network) { return (address & network.mask) == network.address; };
  return std::ranges::any_of(networks_, holds) || (local_ && std::ranges::any_of(interfaces_, holds));
}

bool AcceptedSenders::accepts(std::uint32_t address, std::int64_t now_us) {
  if (contains(address)) return true;
  if (!local_ || (!interfaces_.empty() && now_us - read_us_ < interfaces_age_us)) return false;
  read_us_ = now_us;
  read_interfaces();
  return contains(address);
}

void AcceptedSenders::read_interfaces() {
  // Datagrams that this host sends over an interface without an address, such as a loopback in a namespace,
  // come from 0.0.0.0; Linux accepts none with that source from the network.
  interfaces_ = {{INADDR_LOOPBACK & 0xff000000, 0xff000000}, {0, 0xffffffff}};
  ifaddrs* all = nullptr;
  if (::getifaddrs(&all) != 0) return;
  for (const ifaddrs* each = all; each != nullptr; each = each->ifa_next) {
    if (each->ifa_addr == nullptr || each->ifa_addr->sa_family != AF_INET || each->ifa_netmask == nullptr)
      continue;
    const auto read = [](const sockaddr* from) {
      sockaddr_in address{};
      std::memcpy(&address, from, sizeof address);
      return ntohl(address.sin_addr.s_addr);
    };
    const std::uint32_t mask = read(each->ifa_netmask);
    interfaces_.push_back({read(each->ifa_addr) & mask, mask});
  }
  ::freeifaddrs(all);
}

DatagramSocket::DatagramSocket(AcceptedSenders accepted, DatagramCounters& counters)
    : accepted_(std::move(accepted)), counters_(counters), reader_(counters), bytes_(batch * datagram_bytes) {
  for (std::size_t k = 0; k < batch; ++k) {
    parts_[k] = {bytes_.data() + k * datagram_bytes, datagram_bytes};
    messages_[k].msg_hdr.msg_iov = &parts_[k];
    messages_[k].msg_hdr.msg_iovlen = 1;
  }
}

DatagramSocket::~DatagramSocket() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

// The kernel reports with each datagram how many it has dropped so far.
void DatagramSocket::count_dropped(const msghdr& header) {
  for (cmsghdr* item = CMSG_FIRSTHDR(&header); item != nullptr;
       item = CMSG_NXTHDR(const_cast<msghdr*>(&header), item)) {
    if (item->cmsg_level != SOL_SOCKET || item->cmsg_type != SO_RXQ_OVFL) continue;
    std::uint32_t now = 0;
    std::memcpy(&now, CMSG_DATA(item), sizeof now);
    counters_.add(DatagramFault::kernel, now - dropped_);  // modulo 2^32, as the kernel counts
    dropped_ = now;
  }
}

Result<std::unique_ptr<DatagramSocket>> DatagramSocket::open(const UdpmUrl& url,
                                                             const std::string& interface_address,
                                                             AcceptedSenders accepted,
                                                             DatagramCounters& counters) {
  std::unique_ptr<DatagramSocket> made(new DatagramSocket(std::move(accepted), counters));
  int& descriptor = made->descriptor_;
  const auto set = [&](int level, int option, const auto& value) {
    return ::setsockopt(descriptor, level, option, &value, sizeof value) == 0;
  };
  const auto failed = [](const char* setting, const std::string& what) {
    return fail(Fault::unavailable, setting, what + ": " + std::strerror(errno));
  };
  ip_mreq membership{};
  membership.imr_multiaddr.s_addr = htonl(url.group);
  TRY_ASSIGN(const std::uint32_t own, parse_interface(interface_address));
  membership.imr_interface.s_addr = htonl(own);
  descriptor = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (descriptor < 0) return failed("lcm.url", "cannot open a socket");
  // As liblcm does: several programs of one host listen to one group.
  if (!set(SOL_SOCKET, SO_REUSEADDR, 1)) return failed("lcm.url", "cannot share the port");
  if (url.receive_buffer_bytes > 0 && !set(SOL_SOCKET, SO_RCVBUF, url.receive_buffer_bytes))
    return failed("lcm.url", "cannot set the receive buffer");
  if (!set(SOL_SOCKET, SO_RXQ_OVFL, 1) || !set(IPPROTO_IP, IP_MULTICAST_ALL, 0))
    return failed("lcm.url", "cannot prepare the socket");
  sockaddr_in group{};
  group.sin_family = AF_INET;
  group.sin_addr = membership.imr_multiaddr;
  group.sin_port = htons(url.port);
  if (::bind(descriptor, reinterpret_cast<const sockaddr*>(&group), sizeof group) != 0)
    return failed("lcm.url", "cannot bind to the group");
  if (!set(IPPROTO_IP, IP_ADD_MEMBERSHIP, membership))
    return failed(interface_address.empty() ? "lcm.url" : "lcm.bind_address",
                  "cannot join the group" +
                      (interface_address.empty()
                           ? " (is there a route to it, as `ip route add 224.0.0.0/4 dev lo` adds?)"
                           : " on " + interface_address));
  return made;
}

Result<int> DatagramSocket::receive(int max_datagrams, const Handler& handler) {
  int handled = 0;
  while (handled < max_datagrams) {
    for (std::size_t k = 0; k < batch; ++k) {
      msghdr& header = messages_[k].msg_hdr;
      header.msg_name = &senders_[k];
      header.msg_namelen = sizeof senders_[k];
      header.msg_control = controls_[k].data();
      header.msg_controllen = sizeof controls_[k];
    }
    const auto wanted = static_cast<unsigned>(
        std::min<std::size_t>(batch, static_cast<std::size_t>(max_datagrams - handled)));
    const int count = ::recvmmsg(descriptor_, messages_.data(), wanted, MSG_DONTWAIT, nullptr);
    if (count < 0) {
      // Errors of an interface that goes down are temporary.
      for (const int passing :
           {EAGAIN, EINTR, ENOBUFS, ENOMEM, ENETDOWN, ENETUNREACH, EHOSTUNREACH, ECONNREFUSED})
        if (errno == passing) return handled;
      return fail(Fault::unavailable, "lcm.url", std::string("cannot receive: ") + std::strerror(errno));
    }
    const std::int64_t now_us = monotonic_us(), recv_utime_us = host_utime_us();
    reader_.expire(now_us);
    for (std::size_t k = 0; k < static_cast<std::size_t>(count); ++k) {
      const Sender sender{ntohl(senders_[k].sin_addr.s_addr), ntohs(senders_[k].sin_port)};
      if (!accepted_.accepts(sender.address, now_us)) {
        counters_.received.fetch_add(1, std::memory_order_relaxed);
        counters_.add(DatagramFault::foreign_sender);
        continue;
      }
      const std::span<const std::uint8_t> datagram(bytes_.data() + k * datagram_bytes, messages_[k].msg_len);
      if (const auto message = reader_.take(sender, datagram, now_us))
        handler(sender, *message, recv_utime_us);
    }
    if (count > 0) count_dropped(messages_[static_cast<std::size_t>(count) - 1].msg_hdr);
    handled += count;
    if (static_cast<unsigned>(count) < wanted) break;
  }
  return handled;
}

}  // namespace joulecast::telemetry
