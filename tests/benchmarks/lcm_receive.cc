// Cost of a telemetry message from the socket to the decoded sample, through liblcm and through LcmLink, in
// one run. The sender is at most `window` datagrams ahead of the receiver, so that none is lost, and its CPU
// time is subtracted. Needs multicast on this host:
//   unshare -n sh -c 'ip link set lo up; ip link set lo multicast on; ip route add 224.0.0.0/4 dev lo;
//   lcm_receive'
#include <arpa/inet.h>
#include <lcm/lcm.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <functional>
#include <string>
#include <thread>
#include <type_traits>
#include <vector>

#include "ingest/inbound_message.h"
#include "telemetry/lcm_link.h"

namespace joulecast {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::uint64_t messages = 300'000, window = 2'000;
constexpr std::size_t batch = 64, robots = 50;
constexpr char url[] = "udpm://239.255.76.67:7709?ttl=0&recv_buf_size=4194304";

double cpu_s(clockid_t clock) {
  timespec t{};
  clock_gettime(clock, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

std::vector<std::string> datagrams() {
  std::vector<std::string> all;
  for (std::size_t k = 0; k < robots; ++k) {
    const std::string id = "bench-" + std::to_string(k);
    signals::Sample sample;
    sample.wheel_velocity_rad_s = {1, 1};
    const auto bytes = telemetry::encode_telemetry(id, sample).value();
    std::string datagram("LC02\0\0\0\1", 8);
    datagram += telemetry::channel_of(telemetry::Subject::telemetry, id) + '\0';
    all.push_back(datagram.append(bytes.begin(), bytes.end()));
  }
  return all;
}

// Sends all messages and returns the CPU time used.
double send(const std::atomic<std::uint64_t>& received) {
  std::vector<std::string> all = datagrams();
  const int socket = ::socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in group{};
  group.sin_family = AF_INET;
  group.sin_addr.s_addr = inet_addr("239.255.76.67");
  group.sin_port = htons(7709);
  std::vector<iovec> parts(batch);
  std::vector<mmsghdr> headers(batch);
  for (std::size_t k = 0; k < batch; ++k) {
    std::string& datagram = all[k % robots];
    parts[k] = {datagram.data(), datagram.size()};
    headers[k].msg_hdr.msg_name = &group;
    headers[k].msg_hdr.msg_namelen = sizeof group;
    headers[k].msg_hdr.msg_iov = &parts[k];
    headers[k].msg_hdr.msg_iovlen = 1;
  }
  const auto until = Clock::now() + std::chrono::seconds(60);
  for (std::uint64_t sent = 0; sent < messages && Clock::now() < until;) {
    if (sent >= received + window) {
      std::this_thread::sleep_for(std::chrono::microseconds(50));
      continue;
    }
    const int count = ::sendmmsg(socket, headers.data(),
                                 static_cast<unsigned>(std::min<std::uint64_t>(batch, messages - sent)), 0);
    if (count > 0) sent += static_cast<std::uint64_t>(count);
  }
  ::close(socket);
  return cpu_s(CLOCK_THREAD_CPUTIME_ID);
}

// CPU time per message, in microseconds; `receive` handles and counts the waiting messages.
double run(const char* what, std::atomic<std::uint64_t>& received, const std::function<void()>& receive) {
  double sender_s = 0;
  const double before_s = cpu_s(CLOCK_PROCESS_CPUTIME_ID);
  const auto began = Clock::now();
  std::thread sender([&] { sender_s = send(received); });
  while (received < messages && Clock::now() - began < std::chrono::seconds(60)) receive();
  const double wall_s = std::chrono::duration<double>(Clock::now() - began).count();
  sender.join();
  const double each_us =
      1e6 * (cpu_s(CLOCK_PROCESS_CPUTIME_ID) - before_s - sender_s) / static_cast<double>(received);
  std::printf("%-10s %8llu of %llu messages, %9.0f a second, %6.3f us of CPU each: %9.0f a core second\n",
              what, static_cast<unsigned long long>(received), static_cast<unsigned long long>(messages),
              static_cast<double>(received) / wall_s, each_us, 1e6 / each_us);
  return each_us;
}

}  // namespace
}  // namespace joulecast

int main() {
  using namespace joulecast;
  ingest::IngestCounters counters;
  std::vector<ingest::InboundMessage> batch_of_messages;
  std::atomic<std::uint64_t> received = 0;
  const auto decode = [&](std::string_view channel, std::span<const std::uint8_t> data,
                          const telemetry::Sender& sender) {
    auto message = ingest::decode_message(channel, data, 0, counters, sender);
    if (!message) return;
    batch_of_messages.push_back(std::move(*message));
    if (batch_of_messages.size() >= 1000) batch_of_messages.clear();
    received.fetch_add(1, std::memory_order_relaxed);
  };

  lcm_t* lcm = lcm_create(url);
  if (lcm == nullptr) return 1;
  using Decode = std::remove_const_t<decltype(decode)>;
  lcm_subscription_t* all = lcm_subscribe(
      lcm, "ROBOT_TELEMETRY\\..+",
      [](const lcm_recv_buf_t* buffer, const char* channel, void* user) {
        (*static_cast<const Decode*>(user))(
            channel, {static_cast<const std::uint8_t*>(buffer->data), buffer->data_size}, {});
      },
      const_cast<Decode*>(&decode));
  lcm_subscription_set_queue_capacity(all, 100'000);
  const double liblcm_us = run("liblcm", received, [&] { lcm_handle_timeout(lcm, 100); });
  lcm_destroy(lcm);

  received = 0;
  auto link = telemetry::LcmLink::open(url);
  if (!link) return 1;
  const auto handler = [&](const telemetry::Received& message) {
    decode(message.channel, message.data, message.sender);
  };
  if (const auto listening = link->listen(handler, counters.datagrams); !listening) {
    std::puts(describe(listening.error()).c_str());
    return 1;
  }
  const double own_us = run("LcmLink", received, [&] { (void)link->poll(std::chrono::milliseconds(100)); });
  std::printf("LcmLink takes %.2f of liblcm's CPU time; dropped by the kernel: %llu\n", own_us / liblcm_us,
              static_cast<unsigned long long>(counters.datagrams.faults[0]));
  return own_us < liblcm_us ? 0 : 1;
}
