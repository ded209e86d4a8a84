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
  bool complete = false;                       // ended according to its framing
};

// A blocking TCP client that sends exactly the given bytes. Reads time out after two seconds unless changed.
class RawClient {
 public:
  // A small receive buffer simulates a slow reader; 0 keeps the system's default. `source` is the local
  // address; each address of 127.0.0.0/8 is a separate peer.
  explicit RawClient(std::uint16_t port, int receive_buffer = 0, const char* source = nullptr);
  ~RawClient();
  RawClient(const RawClient&) = delete;
  RawClient& operator=(const RawClient&) = delete;

  void send(
      std::string_view bytes);  // errors are ignored: if the server has disconnected, the next read shows it
  RawReply reply(bool to_head = false);
  void end_sending();  // closes the client's half of the connection only
  // Bytes up to and including `marker`; the bytes so far after a timeout or when the server closes.
  std::string read_until(std::string_view marker);
  // All bytes until the server closes or a timeout.
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
