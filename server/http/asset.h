#pragma once

#include <memory>
#include <string>

#include "server/http/message.h"

namespace joulecast::http {

// A document that is fixed while the service runs, kept plain and, where that is smaller, gzipped.
class Asset {
 public:
  Asset(std::string bytes, std::string content_type, std::string cache_control);

  // The form that the client takes, with an ETag; 304 where it has it.
  Response answer(const Request& request) const;

 private:
  std::string content_type_, cache_control_;
  std::shared_ptr<const std::string> plain_;
  std::shared_ptr<const std::string> gzipped_;  // null where gzip does not pay
  std::string plain_tag_, gzipped_tag_;
};

}  // namespace joulecast::http
