#include "abbe/web/web_users.hpp"

#include <crypt.h>
#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <ctime>
#include <memory>
#include <sstream>

#include "abbe/base/secret_file.hpp"
#include "abbe/base/text_file.hpp"
#include "abbe/result/try.hpp"

namespace abbe::web {
namespace {

using daemon::ErrorCode;
using daemon::Result;

constexpr std::array<std::string_view, 3> kRoleNames{"view", "calibrate", "administer"};
constexpr std::size_t kLongestName = 40;
constexpr const char* kYescrypt = "$y$";  ///< crypt(5): the method that Debian uses for logins

bool is_name(std::string_view name) {
  return !name.empty() && name.size() <= kLongestName && std::ranges::all_of(name, [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' ||
           c == '_' || c == '-';
  });
}

/// crypt(3) of the password; empty if `setting` is not valid.
std::string crypted(const std::string& password, const std::string& setting) {
  auto data = std::make_unique<crypt_data>();  // 32 kB
  const char* hash = ::crypt_r(password.c_str(), setting.c_str(), data.get());
  return hash == nullptr || *hash == '*' ? std::string{} : std::string{hash};
}

bool is_hash(const std::string& hash) {
  const int seen = ::crypt_checksalt(hash.c_str());
  return seen == CRYPT_SALT_OK || seen == CRYPT_SALT_TOO_CHEAP;
}

std::string new_salt() {
  std::array<char, CRYPT_GENSALT_OUTPUT_SIZE> salt{};
  const char* made = ::crypt_gensalt_rn(kYescrypt, 0, nullptr, 0, salt.data(), salt.size());
  return made == nullptr ? std::string{} : std::string{made};
}

/// Takes the same time for every position of the first difference.
bool same_text(std::string_view a, std::string_view b) {
  if (a.size() != b.size()) return false;
  unsigned different = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    different |= static_cast<unsigned char>(a[i]) ^ static_cast<unsigned char>(b[i]);
  return different == 0;
}

/// nullopt for a line that is not NAME:ROLE:HASH.
std::optional<WebUser> user_of_line(const std::string& line) {
  const auto first = line.find(':');
  const auto second = first == std::string::npos ? first : line.find(':', first + 1);
  if (second == std::string::npos) return std::nullopt;
  const auto role = web_role_named(line.substr(first + 1, second - first - 1));
  WebUser user{.name = line.substr(0, first), .hash = line.substr(second + 1)};
  if (!role || !is_name(user.name) || !is_hash(user.hash)) return std::nullopt;
  user.role = *role;
  return user;
}

}  // namespace

std::string_view name(WebRole role) noexcept {
  return kRoleNames[static_cast<std::size_t>(role)];
}

std::optional<WebRole> web_role_named(std::string_view name) noexcept {
  const auto found = std::ranges::find(kRoleNames, name);
  if (found == kRoleNames.end()) return std::nullopt;
  return static_cast<WebRole>(found - kRoleNames.begin());
}

Result<std::vector<WebUser>> read_web_users(const std::filesystem::path& file) {
  ABBE_TRY(daemon::check_secret_mode(file));
  const auto text = daemon::read_regular_file(file);
  ABBE_TRY(text);

  std::vector<WebUser> users;
  std::vector<std::string> faults;
  std::istringstream lines(*text);
  std::size_t number = 0;
  for (std::string line; std::getline(lines, line);) {
    ++number;
    if (line.empty() || line.front() == '#') continue;
    if (auto user = user_of_line(line)) {
      users.push_back(std::move(*user));
    } else {
      faults.push_back(
          fmt::format("{}:{}: must be NAME:ROLE:HASH with the role view, calibrate or "
                      "administer: use the output of `abbe-web --hash-password`",
                      file.string(), number));
    }
  }
  if (faults.empty()) return users;
  return tl::unexpected(daemon::Error{
      ErrorCode::BadInput, fmt::format("{}: {} lines cannot be used", file.string(), faults.size()),
      std::move(faults)});
}

Result<UsersFile::Users> UsersFile::users() {
  const std::lock_guard lock(mutex_);
  struct stat seen {};
  const bool exists = ::stat(file_.c_str(), &seen) == 0;
  constexpr std::int64_t kSecond_ns = 1'000'000'000;
  const std::array<std::int64_t, 4> stamp{static_cast<std::int64_t>(seen.st_ino),
                                          seen.st_ctim.tv_sec * kSecond_ns + seen.st_ctim.tv_nsec,
                                          seen.st_size, seen.st_mode};
  // A file may change twice within the resolution of its times.
  constexpr std::time_t kYoung_s = 2;
  const bool young = std::time(nullptr) - seen.st_ctim.tv_sec < kYoung_s;
  if (!exists || young || read_ != stamp) read();
  read_ = stamp;
  if (good_ != nullptr) return good_;
  return tl::unexpected(*fault_);
}

void UsersFile::read() {
  auto users = read_web_users(file_);
  if (users) {
    if (fault_) report_(fmt::format("{}: can be used again", file_.string()));
    fault_.reset();
    good_ = std::make_shared<const std::vector<WebUser>>(std::move(*users));
    return;
  }
  std::string text = users.error().text;
  for (const std::string& detail : users.error().details) text += "; " + detail;
  const bool known = fault_ && fault_->text == text;
  fault_ = daemon::Error{users.error().code, std::move(text), {}};
  if (!known)
    report_(fmt::format(
        "{}: {}", fault_->text,
        good_ == nullptr ? "nobody can log in" : "the users of the last good file stay"));
}

std::optional<WebUser> find_web_user(const std::vector<WebUser>& users, const std::string& name,
                                     const std::string& password) {
  static const std::string nobody = crypted("", new_salt());
  const auto user = std::ranges::find(users, name, &WebUser::name);
  const std::string& hash = user == users.end() ? nobody : user->hash;
  const std::string seen = crypted(password, hash);
  if (user == users.end() || password.size() > kLongestPassword ||
      password.find('\0') != std::string::npos || seen.empty() || !same_text(seen, hash))
    return std::nullopt;
  return *user;
}

Result<std::string> web_user_line(const std::string& name, WebRole role,
                                  const std::string& password) {
  if (!is_name(name))
    return daemon::fail(ErrorCode::Usage,
                        fmt::format("user \"{}\": a name has 1 to {} of the characters A-Z a-z 0-9 "
                                    ". _ -",
                                    name, kLongestName));
  if (password.size() < kShortestPassword || password.size() > kLongestPassword)
    return daemon::fail(ErrorCode::Usage, fmt::format("the password must have {} to {} bytes",
                                                      kShortestPassword, kLongestPassword));
  const std::string hash = crypted(password, new_salt());
  if (hash.empty()) return daemon::fail(ErrorCode::Io, "crypt(3) does not support yescrypt");
  return fmt::format("{}:{}:{}", name, abbe::web::name(role), hash);
}

}  // namespace abbe::web
