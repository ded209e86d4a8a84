// Digits, tags and content codings of answers.
#include "server/http/delivery.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>
#include <zstd.h>

#include <cmath>
#include <cstdlib>
#include <random>
#include <string>

#include "base/text.h"
#include "server/http/router.h"
#include "server/http/text.h"
#include "tests/server/handled.h"

namespace joulecast::http {
namespace {

TEST(Digits, AreRoundedInDecimal) {
  EXPECT_EQ(rounded("515.6032661275617", 10), "515.6032661");
  EXPECT_EQ(rounded("-0.00012345678951", 9), "-0.00012345679");
  EXPECT_EQ(rounded("9.9999999996", 10), "10");
  EXPECT_EQ(rounded("99.99999999999", 4), "100");
  EXPECT_EQ(rounded("1.2345678901234e-17", 3), "1.23e-17");
  EXPECT_EQ(rounded("9.9999e-17", 2), "10e-17");
  EXPECT_EQ(rounded("1234567.891", 3), "1234568");
  EXPECT_EQ(rounded("1999999.9", 2), "2000000");
  EXPECT_EQ(rounded("0.30000000000000004", 10), "0.3");
  EXPECT_EQ(rounded("1.5", 10), "1.5");
}

TEST(Digits, LeaveIntegersAndTextAlone) {
  const std::string text =
      R"({"utime_us":1795400000123456,"note":"3.14159265358979 \" 2.718281828459045","n":[true,null]})";
  EXPECT_EQ(rounded(text, 3), text);
  EXPECT_EQ(rounded(R"({"a.12345678901":[0.12345678901,-1]})", 2), R"({"a.12345678901":[0.12,-1]})");
}

TEST(Digits, RoundingErrorIsHalfUnit) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> mantissa(-10, 10), exponent(-25, 14);
  for (int k = 0; k < 20'000; ++k) {
    const double number = mantissa(random) * std::pow(10, exponent(random));
    const std::string text = rounded(number_text(number), usual_digits);
    const auto back = to_number<double>(text);
    ASSERT_TRUE(back) << text;
    EXPECT_LE(std::fabs(*back - number), 0.5000001e-9 * std::fabs(number)) << text;
    EXPECT_EQ(rounded(text, usual_digits), text);
  }
}

Response answer_of(const Router& router, std::vector<std::pair<std::string_view, std::string_view>> headers,
                   std::string_view target = "/x") {
  Request request;
  request.method = Method::get;
  request.target = target;
  request.id = "t";
  request.headers = std::move(headers);
  return http::handled(router, request);
}

std::string header(const Response& response, std::string_view name) {
  std::string all;
  for (const auto& [key, value] : response.headers)
    if (equals_ignoring_case(key, name)) all += (all.empty() ? "" : ", ") + value;
  return all;
}

std::string gunzip(std::string_view packed) {
  z_stream stream{};
  EXPECT_EQ(inflateInit2(&stream, 15 + 16), Z_OK);
  std::string plain(1 << 22, '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(packed.data()));
  stream.avail_in = static_cast<uInt>(packed.size());
  stream.next_out = reinterpret_cast<Bytef*>(plain.data());
  stream.avail_out = static_cast<uInt>(plain.size());
  EXPECT_EQ(inflate(&stream, Z_FINISH), Z_STREAM_END);
  plain.resize(stream.total_out);
  inflateEnd(&stream);
  return plain;
}

std::string unzstd(std::string_view packed) {
  std::string plain(1 << 22, '\0');
  ZSTD_DCtx* const context = ZSTD_createDCtx();
  ZSTD_inBuffer in{packed.data(), packed.size(), 0};
  ZSTD_outBuffer out{plain.data(), plain.size(), 0};
  EXPECT_EQ(ZSTD_decompressStream(context, &out, &in), 0U);
  ZSTD_freeDCtx(context);
  plain.resize(out.pos);
  return plain;
}

Endpoint endpoint_of(std::string body) {
  Endpoint endpoint{.path = "/x", .operation_id = "x", .role = Role::open};
  endpoint.handler = [body = std::move(body)](const Request&) -> Result<Response> {
    return json_response(body);
  };
  return endpoint;
}

std::string long_text() {
  std::string text = "[";
  for (int k = 0; k < 2000; ++k) text += std::to_string(k) + ".25,";
  return text + "0]";
}

TEST(Coding, SelectsAcceptedCoding) {
  EXPECT_EQ(coding_of(""), Coding::identity);
  EXPECT_EQ(coding_of("br"), Coding::identity);
  EXPECT_EQ(coding_of("gzip, deflate, br"), Coding::gzip);
  EXPECT_EQ(coding_of("gzip, zstd;q=0.5"), Coding::zstd);
  EXPECT_EQ(coding_of("gzip;q=0, zstd;q=0"), Coding::identity);
  const Router router({endpoint_of(long_text())});
  const Response plain = answer_of(router, {});
  EXPECT_EQ(plain.body, long_text());
  EXPECT_EQ(header(plain, "Content-Encoding"), "");
  EXPECT_EQ(header(plain, "Vary"), "Accept-Encoding");
  const Response gzipped = answer_of(router, {{"accept-encoding", "gzip"}});
  EXPECT_EQ(header(gzipped, "Content-Encoding"), "gzip");
  EXPECT_LT(gzipped.body.size(), long_text().size() / 2);
  EXPECT_EQ(gunzip(gzipped.body), long_text());
  const Response smaller = answer_of(router, {{"accept-encoding", "gzip, zstd"}});
  EXPECT_EQ(header(smaller, "Content-Encoding"), "zstd");
  EXPECT_EQ(unzstd(smaller.body), long_text());
}

TEST(Coding, SkipsShortBodiesAndEvents) {
  EXPECT_EQ(
      header(answer_of(Router({endpoint_of("[1]")}), {{"accept-encoding", "gzip"}}), "Content-Encoding"), "");
  Endpoint on_io = endpoint_of(long_text());
  on_io.run = Run::io;
  EXPECT_EQ(header(answer_of(Router({on_io}), {{"accept-encoding", "gzip"}}), "Content-Encoding"), "");
  Endpoint events = endpoint_of("");
  events.response_type = "text/event-stream";
  events.handler = [](const Request&) -> Result<Response> {
    Response response;
    response.content_type = "text/event-stream";
    response.stream = generate([](std::string& out, const std::stop_token&) {
      out += "data: 1\n\n";
      return false;
    });
    return response;
  };
  EXPECT_EQ(header(answer_of(Router({events}), {{"accept-encoding", "gzip"}}), "Content-Encoding"), "");
}

TEST(Coding, CompressesStreams) {
  for (const Coding coding : {Coding::gzip, Coding::zstd}) {
    int pieces = 0;
    const auto stream = coded(coding, generate([&](std::string& out, const std::stop_token&) {
                                out += long_text();
                                return ++pieces < 3;
                              }));
    std::string packed;
    while (stream->pull(packed) == StreamSource::Next::more) {
    }
    EXPECT_EQ(pieces, 3);
    EXPECT_LT(packed.size(), long_text().size());
    EXPECT_EQ(coding == Coding::gzip ? gunzip(packed) : unzstd(packed),
              long_text() + long_text() + long_text());
  }
}

TEST(Rounding, FollowsRequestedDigits) {
  Endpoint endpoint = endpoint_of(R"({"energy_j":515.6032661275617})");
  endpoint.rounded = true;
  endpoint.parameters = {{.name = "digits", .type = Parameter::Type::integer, .minimum = 2, .maximum = 17}};
  const Router router({endpoint});
  EXPECT_EQ(answer_of(router, {}).body, R"({"energy_j":515.6032661})");
  EXPECT_EQ(answer_of(router, {}, "/x?digits=4").body, R"({"energy_j":515.6})");
  EXPECT_EQ(answer_of(router, {}, "/x?digits=17").body, R"({"energy_j":515.6032661275617})");
  EXPECT_EQ(answer_of(router, {}, "/x?digits=18").status, 422U);
  EXPECT_EQ(answer_of(Router({endpoint_of("[0.12345678901234]")}), {}).body, "[0.12345678901234]");
}

TEST(EntityTag, Returns304OnMatch) {
  Endpoint endpoint = endpoint_of(long_text());
  endpoint.etag = true;
  const Router router({endpoint});
  const Response first = answer_of(router, {{"accept-encoding", "gzip"}});
  const std::string tag = header(first, "ETag");
  ASSERT_TRUE(tag.starts_with("W/\"")) << tag;
  EXPECT_EQ(header(first, "Cache-Control"), "private, no-cache");
  for (const std::string& known : {tag, tag.substr(2), "\"x\", " + tag, std::string("*")}) {
    const Response again = answer_of(router, {{"if-none-match", known}});
    EXPECT_EQ(again.status, 304U) << known;
    EXPECT_TRUE(again.body.empty());
    EXPECT_EQ(header(again, "ETag"), tag);
  }
  EXPECT_EQ(answer_of(router, {{"if-none-match", "\"other\""}}).status, 200U);
  Endpoint other = endpoint_of(long_text() + " ");
  other.etag = true;
  EXPECT_NE(header(answer_of(Router({other}), {}), "ETag"), tag);
}

TEST(CrossOrigin, AllowsConfiguredOrigins) {
  const Cors cors({"https://fleet.example"});
  Request request;
  request.method = Method::options;
  request.headers = {{"origin", "https://fleet.example"}, {"access-control-request-method", "POST"}};
  Response response;
  response.headers = {{"Allow", "POST, OPTIONS"}};
  cors.add_headers(request, response);
  EXPECT_EQ(header(response, "Access-Control-Allow-Origin"), "https://fleet.example");
  EXPECT_EQ(header(response, "Access-Control-Allow-Methods"), "POST, OPTIONS");
  EXPECT_THAT(header(response, "Access-Control-Allow-Headers"), ::testing::HasSubstr("Authorization"));
  for (const char* foreign : {"https://fleet.example.evil", "http://fleet.example", "null", ""}) {
    Response refused;
    request.headers[0].second = foreign;
    cors.add_headers(request, refused);
    EXPECT_EQ(header(refused, "Access-Control-Allow-Origin"), "") << foreign;
    EXPECT_EQ(header(refused, "Vary"), "Origin");
  }
  Response without;
  Cors({}).add_headers(request, without);
  EXPECT_TRUE(without.headers.empty());
}

TEST(CrossOrigin, RejectsInvalidOrigins) {
  for (const char* sound : {"https://fleet.example", "http://10.0.0.7:3000", "http://[::1]:80"})
    EXPECT_TRUE(check_origin(sound)) << sound;
  for (const char* faulty : {"*", "null", "fleet.example", "https://", "https://a/b", "https://A", "ftp://a"})
    EXPECT_FALSE(check_origin(faulty)) << faulty;
}

}  // namespace
}  // namespace joulecast::http
