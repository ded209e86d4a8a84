#include "server/http/asset.h"

#include <utility>

#include "server/http/content_coding.h"
#include "server/http/delivery.h"
#include "server/http/header_list.h"

namespace joulecast::http {

Asset::Asset(std::string bytes, std::string content_type, std::string cache_control)
    : content_type_(std::move(content_type)), cache_control_(std::move(cache_control)) {
  plain_tag_ = entity_tag(bytes).substr(2);  // one form, one tag: strong
  gzipped_tag_ = plain_tag_;
  gzipped_tag_.insert(gzipped_tag_.size() - 1, "-gzip");
  std::string small = gzip_smallest(bytes);
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

}  // namespace joulecast::http
