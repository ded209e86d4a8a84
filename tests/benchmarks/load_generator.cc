// Load of daemon_load.py, cheap enough to share two cores with the daemon, and paced by sleeping to a
// schedule that it catches up with after a delay.
//   load_generator send LOG LCM_PORT RATE
// sends the messages of an LCM event log to 239.255.76.67 as LCM's datagrams;
//   load_generator request HTTP_PORT RATE SECONDS ROBOT MISSION
// requests a profile and a mission alternately. Both print their own CPU time for each message or
// request.
#include <arpa/inet.h>
#include <sys/socket.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <string>
#include <thread>
#include <vector>

#include "telemetry/event_log.h"
#include "tests/benchmarks/http_load.h"

namespace joulecast::benchmarks {
namespace {

using Clock = std::chrono::steady_clock;
using Seconds = std::chrono::duration<double>;

[[noreturn]] void give_up(const char* what) {
  std::perror(what);
  std::exit(1);
}

double cpu_s() {
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

class Schedule {
 public:
  explicit Schedule(double rate_1_s) : rate_1_s_(rate_1_s) {}
  double elapsed_s() const { return Seconds(Clock::now() - began_).count(); }
  // Sleeps until number `k` is due.
  void await(double k) const {
    std::this_thread::sleep_until(began_ +
                                  std::chrono::duration_cast<Clock::duration>(Seconds(k / rate_1_s_)));
  }

 private:
  double rate_1_s_;
  Clock::time_point began_ = Clock::now();
};

class Sender {
 public:
  explicit Sender(std::uint16_t port) : socket_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in group{};
    group.sin_family = AF_INET;
    group.sin_addr.s_addr = inet_addr("239.255.76.67");
    group.sin_port = htons(port);
    const unsigned char ttl = 0;
    if (::setsockopt(socket_, IPPROTO_IP, IP_MULTICAST_TTL, &ttl, sizeof ttl) != 0) give_up("setsockopt");
    if (::connect(socket_, reinterpret_cast<const sockaddr*>(&group), sizeof group) != 0) give_up("connect");
    headers_.resize(batch);
    parts_.resize(batch);
    datagrams_.resize(batch);
  }

  void add(const telemetry::LogEvent& event) {
    const std::uint32_t number = htonl(sent_ + static_cast<std::uint32_t>(waiting_));
    std::string& datagram = datagrams_[waiting_++];
    datagram.assign("LC02").append(reinterpret_cast<const char*>(&number), sizeof number);
    datagram.append(event.channel).push_back('\0');
    datagram.append(reinterpret_cast<const char*>(event.data.data()), event.data.size());
  }
  bool is_full() const { return waiting_ == batch; }
  void send() {
    for (std::size_t k = 0; k < waiting_; ++k) {
      parts_[k] = {datagrams_[k].data(), datagrams_[k].size()};
      headers_[k].msg_hdr.msg_iov = &parts_[k];
      headers_[k].msg_hdr.msg_iovlen = 1;
    }
    for (std::size_t k = 0; k < waiting_;) {
      const int count = ::sendmmsg(socket_, headers_.data() + k, static_cast<unsigned>(waiting_ - k), 0);
      if (count < 0) give_up("sendmmsg");
      k += static_cast<std::size_t>(count);
    }
    sent_ += static_cast<std::uint32_t>(waiting_);
    waiting_ = 0;
  }
  std::uint32_t sent() const { return sent_; }

 private:
  static constexpr std::size_t batch = 64;  // a millisecond of 60,000 messages a second

  int socket_;
  std::vector<mmsghdr> headers_;
  std::vector<iovec> parts_;
  std::vector<std::string> datagrams_;
  std::size_t waiting_ = 0;
  std::uint32_t sent_ = 0;
};

int send(const std::string& log, std::uint16_t port, double rate_1_s) {
  Sender sender(port);
  telemetry::LogTally tally;
  const Schedule schedule(rate_1_s);
  const auto take = [&](const telemetry::LogEvent& event) -> Result<bool> {
    sender.add(event);
    if (!sender.is_full()) return true;
    schedule.await(sender.sent());
    sender.send();
    return true;
  };
  if (!telemetry::read_events(log, take, tally)) give_up(log.c_str());
  sender.send();
  std::printf("sent %u messages in %.1f s: %.0f a second, %.2f us each\n", sender.sent(),
              schedule.elapsed_s(), sender.sent() / schedule.elapsed_s(), 1e6 * cpu_s() / sender.sent());
  return 0;
}

void print_times(const char* name, std::vector<double>& times_ms) {
  std::ranges::sort(times_ms);
  const auto at = [&](double q) {
    return times_ms[static_cast<std::size_t>(q * static_cast<double>(times_ms.size() - 1))];
  };
  std::printf("%s: %zu calls, median %.2f ms, p99 %.2f ms, longest %.1f ms\n", name, times_ms.size(), at(0.5),
              at(0.99), at(1));
}

int request(std::uint16_t port, double rate_1_s, double seconds, const std::string& robot,
            const std::string& mission) {
  const std::string profile = http_request_text("/v1/robots/" + robot + "/profile",
                                                R"({"path":[{"kind":"straight","length_m":10}]})");
  const std::string summary = http_request_text("/v1/missions/" + mission);
  HttpConnection connection(port);
  std::vector<double> profile_ms, summary_ms;
  const Schedule schedule(rate_1_s);
  const auto count = static_cast<int>(rate_1_s * seconds);
  for (int k = 0; k < count; ++k) {
    schedule.await(k);
    const auto began = Clock::now();
    connection.exchange(k % 2 == 0 ? profile : summary);
    (k % 2 == 0 ? profile_ms : summary_ms)
        .push_back(std::chrono::duration<double, std::milli>(Clock::now() - began).count());
  }
  std::printf("%d requests answered in %.1f s: %.0f a second, %.1f us each of the client\n", count,
              schedule.elapsed_s(), count / schedule.elapsed_s(), 1e6 * cpu_s() / count);
  print_times("profile", profile_ms);
  print_times("mission", summary_ms);
  return 0;
}

std::uint16_t port_of(const char* text) {
  return static_cast<std::uint16_t>(std::atoi(text));
}

}  // namespace
}  // namespace joulecast::benchmarks

int main(int count, char** arguments) {
  using namespace joulecast::benchmarks;
  const std::string what = count > 1 ? arguments[1] : "";
  if (what == "send" && count == 5) return send(arguments[2], port_of(arguments[3]), std::atof(arguments[4]));
  if (what == "request" && count == 7)
    return request(port_of(arguments[2]), std::atof(arguments[3]), std::atof(arguments[4]), arguments[5],
                   arguments[6]);
  std::fputs("usage: load_generator send LOG LCM_PORT RATE | request HTTP_PORT RATE SECONDS ROBOT MISSION\n",
             stderr);
  return 2;
}
