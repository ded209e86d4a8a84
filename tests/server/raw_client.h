#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>

namespace joulecast::test {

struct RawReply {
  unsigned status = 0;
  std::string head;
  std::map<std::string, std::string> headers;  // names in lower case
  std::string body;                            // chunked bodies joined
  bool complete = false;                       // ended as its framing says
};

// A blocking TCP client that sends exactly the bytes it is told. Reads give up after two seconds unless told.
class RawClient {
 public:
  // A small receive buffer lets a test play the slow reader; 0 leaves the system's. `source` is the address
  // to come from: one of 127.0.0.0/8 makes a peer of its own.
  explicit RawClient(std::uint16_t port, int receive_buffer = 0, const char* source = nullptr);
  ~RawClient();
  RawClient(const RawClient&) = delete;
  RawClient& operator=(const RawClient&) = delete;

  void send(
      std::string_view bytes);  // errors are ignored: the server may have hung up, which reads will show
  RawReply reply(bool to_head = false);
  void end_sending();  // the client's half of the connection only
  // Bytes until `marker` has arrived (inclusive); what there is when the time is over or the server closes.
  std::string read_until(std::string_view marker);
  // All bytes until the server closes or patience ends.
  std::string read_to_end();
  // True when the server has closed (end of file or reset) within the time.
  bool closed_within(std::chrono::milliseconds time);
  void close();
  void patience(std::chrono::milliseconds time) { patience_ = time; }

 private:
  bool fill();
  int socket_ = -1;
  std::string buffer_;
  std::chrono::milliseconds patience_{2000};
};

// "GET <target> HTTP/1.1" with a Host header and the given further lines, each ending in CRLF.
std::string get_text(std::string_view target, std::string_view lines = {});
std::string post_text(std::string_view target, std::string_view body, std::string_view lines = {});

}  // namespace joulecast::test
