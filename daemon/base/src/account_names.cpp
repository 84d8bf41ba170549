#include "abbe/base/account_names.hpp"

#include <fmt/format.h>
#include <grp.h>
#include <pwd.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <condition_variable>
#include <cstdio>
#include <cstring>
#include <map>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

namespace abbe::daemon {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::size_t kLargestGroupEntry = 1u << 20;  // bytes of a group entry with all its members
constexpr std::size_t kFirstBuffer = 16384;

struct CloseFile {
  void operator()(std::FILE* file) const { (void)std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, CloseFile>;

/// Calls `find` with larger buffers until the entry fits.
template <class Find>
int with_buffer(Find find) {
  std::vector<char> strings(kFirstBuffer);
  for (;;) {
    const int error = find(strings);
    if (error != ERANGE || strings.size() >= kLargestGroupEntry) return error;
    strings.resize(2 * strings.size());
  }
}

std::optional<std::string> user_from_file(const std::filesystem::path& path, uid_t uid) {
  const File file{std::fopen(path.c_str(), "re")};
  if (!file) return std::nullopt;
  passwd entry{};
  passwd* found = nullptr;
  std::vector<char> strings(kFirstBuffer);
  while (::fgetpwent_r(file.get(), &entry, strings.data(), strings.size(), &found) == 0)
    if (found->pw_uid == uid) return found->pw_name;
  return std::nullopt;
}

std::optional<gid_t> group_from_file(const std::filesystem::path& path, const std::string& name) {
  const File file{std::fopen(path.c_str(), "re")};
  if (!file) return std::nullopt;
  group entry{};
  group* found = nullptr;
  std::optional<gid_t> id;
  with_buffer([&](std::vector<char>& strings) {
    std::rewind(file.get());
    for (;;) {
      const int error = ::fgetgrent_r(file.get(), &entry, strings.data(), strings.size(), &found);
      if (error != 0) return error;
      if (name == found->gr_name) {
        id = found->gr_gid;
        return 0;
      }
    }
  });
  return id;
}

}  // namespace

std::optional<std::string> user_from_name_service(uid_t uid) {
  passwd entry{};
  passwd* found = nullptr;
  std::optional<std::string> name;
  with_buffer([&](std::vector<char>& strings) {
    const int error = ::getpwuid_r(uid, &entry, strings.data(), strings.size(), &found);
    if (found != nullptr) name = found->pw_name;
    return error;
  });
  return name;
}

std::optional<Account> account_of(const std::string& user) {
  passwd entry{};
  passwd* found = nullptr;
  std::vector<char> strings(kFirstBuffer);
  if (const File file{std::fopen("/etc/passwd", "re")})
    while (::fgetpwent_r(file.get(), &entry, strings.data(), strings.size(), &found) == 0)
      if (user == found->pw_name) return Account{found->pw_uid, found->pw_gid};
  if (::getpwnam_r(user.c_str(), &entry, strings.data(), strings.size(), &found) != 0 ||
      found == nullptr)
    return std::nullopt;
  return Account{found->pw_uid, found->pw_gid};
}

std::optional<gid_t> group_from_name_service(const std::string& name) {
  group entry{};
  group* found = nullptr;
  with_buffer([&](std::vector<char>& strings) {
    return ::getgrnam_r(name.c_str(), &entry, strings.data(), strings.size(), &found);
  });
  return found != nullptr ? std::optional{found->gr_gid} : std::nullopt;
}

struct AccountNames::Shared : std::enable_shared_from_this<Shared> {
  template <class Value>
  struct Answer {
    std::optional<Value> value;
    std::optional<Clock::time_point> at;  ///< nullopt: not answered yet
    bool asked = false;                   ///< a thread waits for the name service
  };

  explicit Shared(AccountNamesOptions o) : options(std::move(o)) {}

  AccountNamesOptions options;
  std::mutex mutex;
  std::condition_variable answered;
  std::map<uid_t, Answer<std::string>> users;
  std::map<std::string, Answer<gid_t>> groups;
  std::size_t look_ups = 0;

  /// The present answer for the key. If it is missing or old, a new answer is first requested: from
  /// the local file at once, from the name service in the background.
  template <class Key, class Value, class FromFile, class FromService>
  std::optional<Value> find(std::map<Key, Answer<Value>>& answers, const Key& key,
                            FromFile from_file, FromService from_service) {
    std::unique_lock lock(mutex);
    Answer<Value>& known = answers[key];
    const auto now = Clock::now();
    if (known.asked || (known.at && now - *known.at < options.fresh)) return known.value;

    if (auto local = from_file()) {
      known.value = std::move(*local);
      known.at = now;
    } else {
      ask(answers, key, known, from_service);
    }
    return known.value;
  }

  template <class Key, class Value, class FromService>
  void ask(std::map<Key, Answer<Value>>& answers, const Key& key, Answer<Value>& known,
           FromService from_service) {
    if (look_ups >= options.most_look_ups) return;
    try {
      // Detached: the end of the process does not wait for a name service.
      std::thread([self = shared_from_this(), &answers, key, from_service] {
        auto value = from_service(key);
        const std::lock_guard lock(self->mutex);
        answers[key] = {std::move(value), Clock::now(), false};
        --self->look_ups;
        self->answered.notify_all();
      }).detach();
    } catch (const std::system_error&) {
      return;  // the thread could not be started: the next request asks again
    }
    known.asked = true;
    ++look_ups;
  }
};

AccountNames::AccountNames(AccountNamesOptions options)
    : shared_(std::make_shared<Shared>(std::move(options))) {}
AccountNames::~AccountNames() = default;

std::string AccountNames::user(uid_t uid) {
  Shared& s = *shared_;
  {
    const std::lock_guard lock(s.mutex);
    if (s.users.size() >= s.options.most_users)
      std::erase_if(s.users, [](const auto& entry) { return !entry.second.asked; });
  }
  const auto name = s.find(
      s.users, uid, [&] { return user_from_file(s.options.users, uid); }, s.options.user_service);
  return name.value_or(fmt::format("uid {}", uid));
}

std::optional<gid_t> AccountNames::group(const std::string& name) {
  Shared& s = *shared_;
  return s.find(
      s.groups, name, [&] { return group_from_file(s.options.groups, name); },
      s.options.group_service);
}

void AccountNames::look_up(std::span<const std::string> groups, std::chrono::milliseconds at_most) {
  for (const auto& name : groups)
    if (!name.empty()) (void)group(name);
  std::unique_lock lock(shared_->mutex);
  shared_->answered.wait_for(lock, at_most, [this] { return shared_->look_ups == 0; });
}

AccountNames& account_names() {
  static auto& names = *new AccountNames;  // NOLINT: threads may use it until the process ends
  return names;
}

}  // namespace abbe::daemon
