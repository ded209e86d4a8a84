#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "server/http/message.h"

namespace joulecast::http {

// Server-sent events: a published event goes to every subscriber through a bounded queue of its own. A
// subscriber with a full queue is disconnected without a notice, and counted; it may reconnect with
// Last-Event-ID. Event ids are "<epoch>-<n>", where the epoch identifies this run of the daemon. A returning
// client with an id in the backlog receives the events since then; any other id is answered by an event
// "reset": the client must read the state again.
class EventHub {
 public:
  struct Options {
    std::size_t queue_bytes = 8 * 1024 * 1024;  // per client
    std::size_t backlog_bytes = 512 * 1024;     // kept for returning clients
    std::chrono::milliseconds heartbeat{15'000};
    std::size_t max_subscribers = 256;  // a quarter of them of one client
  };
  struct Counts {
    std::uint64_t published = 0;
    std::uint64_t dropped_clients = 0;
    std::size_t subscribers = 0;
  };

  EventHub();
  explicit EventHub(const Options& options);
  ~EventHub();

  // A state outdates earlier ones of its topic: a slow client receives the newest only.
  enum class Of : std::uint8_t { occurrence, state };
  // Any thread; never blocks on a client. `data` is one JSON text, `topic` is the key by which subscribers
  // select (a robot's id; empty goes to all).
  void publish(std::string_view event, std::string_view data, std::string_view topic = {},
               Of of = Of::occurrence);

  // An event stream of one client; an empty topic selects everything. Beyond max_subscribers the oldest of
  // the client that has most of them ends; Fault::unavailable where that is this one, and beyond its quarter
  // (one without a name has none). A stream may outlive its hub and then ends.
  Result<std::shared_ptr<StreamSource>> subscribe(std::string_view last_event_id = {},
                                                  std::string_view topic = {}, std::string_view client = {});

  // text/event-stream around subscribe(), honouring the request's Last-Event-ID header.
  Result<Response> respond(const Request& request, std::string_view topic = {});

  Counts counts() const;

 private:
  struct Event;
  struct Subscriber;

  // For another stream of that client, see subscribe().
  bool make_room(const std::string& client);
  std::size_t count_living() const;

  const Options options_;
  const std::string epoch_;
  mutable std::mutex mutex_;
  std::uint64_t next_number_ = 1;
  std::deque<std::shared_ptr<const Event>> backlog_;
  std::size_t backlog_bytes_ = 0;
  mutable std::vector<std::weak_ptr<Subscriber>> subscribers_;
  std::uint64_t dropped_ = 0;
};

}  // namespace joulecast::http
