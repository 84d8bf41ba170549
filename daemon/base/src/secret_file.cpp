#include "abbe/base/secret_file.hpp"

#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "abbe/base/text_file.hpp"
#include "abbe/result/try.hpp"

namespace abbe::daemon {
namespace {

constexpr std::size_t kLongestSecret = 4096;

bool is_ascii_control(char c) {
  return static_cast<unsigned char>(c) < 0x20 || c == 0x7F;
}

}  // namespace

Result<void> check_secret_mode(const std::filesystem::path& file) {
  struct stat seen {};
  if (::stat(file.c_str(), &seen) != 0)
    return fail(ErrorCode::Io, fmt::format("read {}: {}", file.string(), std::strerror(errno)));
  if ((seen.st_mode & (S_IRWXO | S_IWGRP)) == 0) return {};
  return fail(ErrorCode::BadInput,
              fmt::format("{}: other users may read or change it: chmod 0640 {}", file.string(),
                          file.string()));
}

Result<std::string> read_secret(const std::filesystem::path& file) {
  ABBE_TRY(check_secret_mode(file));
  auto text = read_regular_file(file);
  ABBE_TRY(text);

  while (!text->empty() && (text->back() == '\n' || text->back() == '\r')) text->pop_back();
  if (text->empty() || text->size() > kLongestSecret ||
      std::ranges::any_of(*text, is_ascii_control))
    return fail(ErrorCode::BadInput, fmt::format("{}: must be one line of 1 to {} bytes",
                                                 file.string(), kLongestSecret));
  return text;
}

}  // namespace abbe::daemon
