#include "server/network_file_system.h"

#include <linux/magic.h>
#include <sys/statfs.h>

#include <filesystem>

namespace joulecast {

std::string_view network_file_system_of_type(std::int64_t type) {
  switch (static_cast<std::uint32_t>(type)) {
    case NFS_SUPER_MAGIC:
      return "NFS";
    case SMB_SUPER_MAGIC:
    case CIFS_SUPER_MAGIC:
    case SMB2_SUPER_MAGIC:
      return "SMB";
    case AFS_SUPER_MAGIC:
    case AFS_FS_MAGIC:
      return "AFS";
    case CODA_SUPER_MAGIC:
      return "Coda";
    case V9FS_MAGIC:
      return "9P";
    case CEPH_SUPER_MAGIC:
      return "CephFS";
    case OCFS2_SUPER_MAGIC:
      return "OCFS2";
    default:
      return "";
  }
}

std::string_view network_file_system(const std::string& path) {
  struct statfs info {};
  std::string folder = std::filesystem::path(path).parent_path().string();
  if (folder.empty()) folder = ".";
  if (statfs(path.c_str(), &info) != 0 && statfs(folder.c_str(), &info) != 0) return "";
  return network_file_system_of_type(info.f_type);
}

}  // namespace joulecast
