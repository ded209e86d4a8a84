#include "server/http/delivery.h"

#include <fmt/format.h>
#include <zlib.h>
#include <zstd.h>

#include <array>
#include <boost/core/noncopyable.hpp>

#include "server/http/text.h"

namespace joulecast::http {
namespace {

// Weak: it holds for every content coding. "W/\"<hash>\"".
std::string entity_tag(std::string_view bytes) {
  return fmt::format("W/\"{:x}\"", fnv1a(bytes));
}

constexpr std::size_t least_coded_bytes = 1024;

// How long a browser may cache the answer to a preflight request.
constexpr const char* preflight_age_s = "600";

std::string& own_body(Response& response) {
  if (response.shared_body) response.body = *std::exchange(response.shared_body, nullptr);
  return response.body;
}

void round(const Request& request, Response& response) {
  const auto digits = static_cast<int>(request.query_integer("digits").value_or(usual_digits));
  if (digits < all_digits) response.body = rounded(std::move(own_body(response)), digits);
}

// True when the client has it.
bool tag(const Request& request, Response& response) {
  const std::string made = entity_tag(body_of(response));
  response.headers.emplace_back("ETag", made);
  response.headers.emplace_back("Cache-Control", "private, no-cache");
  if (!lists(request.header("if-none-match"), std::string_view(made).substr(2))) return false;
  response.status = 304;
  own_body(response).clear();
  return true;
}

void code(const Request& request, Response& response) {
  const Coding coding = coding_of(request.header("accept-encoding"));
  if (coding == Coding::identity) return;
  if (response.stream) {
    response.stream = coded(coding, std::move(response.stream));
  } else {
    std::string smaller = coded(coding, body_of(response));
    if (smaller.empty() || smaller.size() >= body_of(response).size()) return;
    own_body(response) = std::move(smaller);
  }
  response.headers.emplace_back("Content-Encoding", name(coding));
}

// Answers are coded on demand: speed counts more than the last tenth of size.
constexpr int gzip_level = 4;
constexpr int zstd_level = 1;
constexpr int gzip_window = 15 + 16;
constexpr std::size_t step_bytes = 64 * 1024;

// Appends coded pieces of one body.
class Coder {
 public:
  enum class Until : std::uint8_t { later, now, end };  // how much of the input must be output
  virtual ~Coder() = default;
  virtual bool add(std::string_view bytes, Until until, std::string& out) = 0;
};

class GzipCoder final : public Coder, boost::noncopyable {
 public:
  explicit GzipCoder(int level) {
    ready_ = deflateInit2(&stream_, level, Z_DEFLATED, gzip_window, 8, Z_DEFAULT_STRATEGY) == Z_OK;
  }
  ~GzipCoder() override { deflateEnd(&stream_); }

  bool add(std::string_view bytes, Until until, std::string& out) override {
    if (!ready_) return false;
    const int flush = until == Until::end ? Z_FINISH : until == Until::now ? Z_SYNC_FLUSH : Z_NO_FLUSH;
    stream_.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));  // zlib only reads it
    stream_.avail_in = static_cast<uInt>(bytes.size());
    do {
      stream_.next_out = step_.data();
      stream_.avail_out = static_cast<uInt>(step_.size());
      if (deflate(&stream_, flush) == Z_STREAM_ERROR) return false;
      out.append(reinterpret_cast<const char*>(step_.data()), step_.size() - stream_.avail_out);
    } while (stream_.avail_out == 0);
    return true;
  }

 private:
  z_stream stream_{};
  bool ready_ = false;
  std::array<Bytef, step_bytes> step_;
};

class ZstdCoder final : public Coder, boost::noncopyable {
 public:
  ZstdCoder() : stream_(ZSTD_createCCtx()) {
    if (stream_ != nullptr) ZSTD_CCtx_setParameter(stream_, ZSTD_c_compressionLevel, zstd_level);
  }
  ~ZstdCoder() override { ZSTD_freeCCtx(stream_); }

  bool add(std::string_view bytes, Until until, std::string& out) override {
    if (stream_ == nullptr) return false;
    const ZSTD_EndDirective directive = until == Until::end   ? ZSTD_e_end
                                        : until == Until::now ? ZSTD_e_flush
                                                              : ZSTD_e_continue;
    ZSTD_inBuffer in{bytes.data(), bytes.size(), 0};
    for (;;) {
      ZSTD_outBuffer step{step_.data(), step_.size(), 0};
      const std::size_t rest = ZSTD_compressStream2(stream_, &step, &in, directive);
      if (ZSTD_isError(rest) != 0U) return false;
      out.append(step_.data(), step.pos);
      const bool done = until == Until::later ? in.pos == in.size : rest == 0;
      if (done) return true;
    }
  }

 private:
  ZSTD_CCtx* stream_;
  std::array<char, step_bytes> step_;
};

std::unique_ptr<Coder> coder_of(Coding coding) {
  if (coding == Coding::zstd) return std::make_unique<ZstdCoder>();
  return std::make_unique<GzipCoder>(gzip_level);
}

std::string all_of(Coder& coder, std::string_view bytes) {
  std::string out;
  return coder.add(bytes, Coder::Until::end, out) ? out : std::string();
}

class CodedStream final : public StreamSource {
 public:
  CodedStream(Coding coding, std::shared_ptr<StreamSource> inner)
      : coder_(coder_of(coding)), inner_(std::move(inner)) {}

  Next pull(std::string& out) override {
    piece_.clear();
    const Next next = inner_->pull(piece_);
    if (next == Next::abort) return next;
    const auto until = next == Next::end    ? Coder::Until::end
                       : next == Next::wait ? Coder::Until::now
                                            : Coder::Until::later;
    return coder_->add(piece_, until, out) ? next : Next::abort;
  }
  void on_wake(std::function<void()> wake) override { inner_->on_wake(std::move(wake)); }
  void cancel() override { inner_->cancel(); }
  bool must_close() const override { return inner_->must_close(); }
  bool endless() const override { return inner_->endless(); }
  bool on_worker() const override { return inner_->on_worker(); }

 private:
  std::unique_ptr<Coder> coder_;
  std::shared_ptr<StreamSource> inner_;
  std::string piece_;
};

}  // namespace

void deliver(const Endpoint& endpoint, const Request& request, Response& response, bool on_io) {
  if (response.status != endpoint.success_status || !response.header("Content-Encoding").empty()) return;
  std::string vary = endpoint.csv ? "Accept" : "";
  if (endpoint.rounded && response.content_type.starts_with("application/json") && !response.stream)
    round(request, response);
  const bool known = endpoint.etag && !response.stream && tag(request, response);
  const bool large = response.stream || body_of(response).size() >= least_coded_bytes;
  if (!on_io && endpoint.response_type != "text/event-stream" && large) {
    vary += vary.empty() ? "Accept-Encoding" : ", Accept-Encoding";
    if (!known) code(request, response);
  }
  if (!vary.empty()) response.headers.emplace_back("Vary", std::move(vary));
}

Asset::Asset(std::string bytes, std::string content_type, std::string cache_control)
    : content_type_(std::move(content_type)), cache_control_(std::move(cache_control)) {
  plain_tag_ = entity_tag(bytes).substr(2);  // one form, one tag: strong
  gzipped_tag_ = plain_tag_;
  gzipped_tag_.insert(gzipped_tag_.size() - 1, "-gzip");
  GzipCoder coder(Z_BEST_COMPRESSION);  // coded once and sent often
  std::string small = all_of(coder, bytes);
  if (!small.empty() && small.size() < bytes.size())
    gzipped_ = std::make_shared<const std::string>(std::move(small));
  plain_ = std::make_shared<const std::string>(std::move(bytes));
}

Response Asset::answer(const Request& request) const {
  const bool compressed = gzipped_ && lists(request.header("accept-encoding"), "gzip");
  const std::string& tag = compressed ? gzipped_tag_ : plain_tag_;
  Response response;
  response.content_type = content_type_;
  response.headers = {{"ETag", tag}, {"Cache-Control", cache_control_}, {"Vary", "Accept-Encoding"}};
  if (lists(request.header("if-none-match"), tag)) {
    response.status = 304;
    return response;
  }
  if (compressed) response.headers.emplace_back("Content-Encoding", "gzip");
  response.shared_body = compressed ? gzipped_ : plain_;
  return response;
}

std::string_view name(Coding coding) {
  return coding == Coding::gzip ? "gzip" : coding == Coding::zstd ? "zstd" : "identity";
}

Coding coding_of(std::string_view accept_encoding) {
  if (accept_encoding.empty()) return Coding::identity;
  if (lists(accept_encoding, "zstd")) return Coding::zstd;
  return lists(accept_encoding, "gzip") ? Coding::gzip : Coding::identity;
}

std::string coded(Coding coding, std::string_view bytes) {
  return all_of(*coder_of(coding), bytes);
}

std::shared_ptr<StreamSource> coded(Coding coding, std::shared_ptr<StreamSource> inner) {
  return std::make_shared<CodedStream>(coding, std::move(inner));
}

void Cors::add_headers(const Request& request, Response& response) const {
  if (origins_.empty()) return;
  response.headers.emplace_back("Vary", "Origin");
  const std::string origin(request.header("origin"));
  if (!allows(origin)) return;
  response.headers.emplace_back("Access-Control-Allow-Origin", origin);
  if (request.method == Method::options && !request.header("access-control-request-method").empty()) {
    const std::string methods(response.header("Allow"));
    response.headers.emplace_back("Access-Control-Allow-Methods", methods);
    response.headers.emplace_back(
        "Access-Control-Allow-Headers",
        "Accept, Authorization, Cache-Control, Content-Type, Idempotency-Key, If-None-Match, Last-Event-ID, "
        "X-Request-Id");
    response.headers.emplace_back("Access-Control-Max-Age", preflight_age_s);
  } else {
    response.headers.emplace_back("Access-Control-Expose-Headers",
                                  "Deprecation, ETag, Idempotency-Replayed, Link, Location, Retry-After, "
                                  "WWW-Authenticate, X-Request-Id");
  }
}

Result<void> check_origin(std::string_view origin) {
  const auto scheme = origin.find("://");
  const std::string_view kind = origin.substr(0, std::min(scheme, origin.size()));
  const std::string_view host = scheme == std::string_view::npos ? "" : origin.substr(scheme + 3);
  const bool plain =
      host.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789.-:[]") == std::string_view::npos;
  if ((kind == "http" || kind == "https") && !host.empty() && plain) return {};
  return invalid("http.allowed_origins",
                 "has " + std::string(origin) +
                     ", must be origins such as https://fleet.example or http://10.0.0.7:3000, in lower case "
                     "and without a path");
}

}  // namespace joulecast::http
