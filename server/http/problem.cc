#include "server/http/problem.h"

#include <nlohmann/json.hpp>

namespace joulecast::http {
namespace {

std::string_view slug_of(Fault fault) {
  switch (fault) {
    case Fault::invalid:
      return "invalid";
    case Fault::not_found:
      return "not-found";
    case Fault::conflict:
      return "conflict";
    case Fault::infeasible:
      return "infeasible";
    case Fault::too_large:
      return "too-large";
    case Fault::stopped:
    case Fault::unavailable:
      return "unavailable";
    case Fault::corrupt:
      return "corrupt";
    case Fault::internal:
      break;
  }
  return "internal";
}

}  // namespace

unsigned status_of(Fault fault) {
  switch (fault) {
    case Fault::invalid:
    case Fault::infeasible:
      return 422;
    case Fault::not_found:
      return 404;
    case Fault::conflict:
      return 409;
    case Fault::too_large:
      return 413;
    case Fault::stopped:
    case Fault::unavailable:
      return 503;
    case Fault::corrupt:
    case Fault::internal:
      break;
  }
  return 500;
}

std::string_view reason_phrase(unsigned status) {
  switch (status) {
    case 100:
      return "Continue";
    case 200:
      return "OK";
    case 201:
      return "Created";
    case 202:
      return "Accepted";
    case 204:
      return "No Content";
    case 206:
      return "Partial Content";
    case 301:
      return "Moved Permanently";
    case 303:
      return "See Other";
    case 304:
      return "Not Modified";
    case 308:
      return "Permanent Redirect";
    case 400:
      return "Bad Request";
    case 401:
      return "Unauthorized";
    case 403:
      return "Forbidden";
    case 404:
      return "Not Found";
    case 405:
      return "Method Not Allowed";
    case 406:
      return "Not Acceptable";
    case 408:
      return "Request Timeout";
    case 409:
      return "Conflict";
    case 412:
      return "Precondition Failed";
    case 413:
      return "Content Too Large";
    case 414:
      return "URI Too Long";
    case 415:
      return "Unsupported Media Type";
    case 417:
      return "Expectation Failed";
    case 421:
      return "Misdirected Request";
    case 422:
      return "Unprocessable Content";
    case 429:
      return "Too Many Requests";
    case 431:
      return "Request Header Fields Too Large";
    case 499:
      return "Client Closed Request";
    case 500:
      return "Internal Server Error";
    case 501:
      return "Not Implemented";
    case 503:
      return "Service Unavailable";
    case 505:
      return "HTTP Version Not Supported";
    default:
      return "Status";
  }
}

Response problem(unsigned status, std::string_view slug, std::string_view detail, std::string_view request_id,
                 std::string_view field, std::string_view constraint) {
  nlohmann::ordered_json document;
  document["type"] = "urn:joulecast:problem:" + std::string(slug);
  document["title"] = reason_phrase(status);
  document["status"] = status;
  document["detail"] = detail;
  if (!request_id.empty()) {
    document["instance"] = "urn:joulecast:request:" + std::string(request_id);
    document["request_id"] = request_id;
  }
  if (!field.empty()) document["field"] = field;
  if (!constraint.empty()) document["constraint"] = constraint;
  Response response;
  response.status = status;
  response.content_type = "application/problem+json";
  // Messages can quote the client's input, which need not be UTF-8.
  response.body = document.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
  if (status == 429 || status == 503) response.headers.emplace_back("Retry-After", "1");
  return response;
}

Response problem(const Error& error, std::string_view request_id) {
  const unsigned status = status_of(error.fault);
  if (status == 500) {
    return problem(status, slug_of(error.fault),
                   "The service failed on this request; its log has the cause under the request id.",
                   request_id);
  }
  const bool callers = status != 503;
  return problem(status, slug_of(error.fault), describe(error), request_id, error.field,
                 callers ? std::string_view(error.message) : std::string_view{});
}

}  // namespace joulecast::http
