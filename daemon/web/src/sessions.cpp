#include "abbe/web/sessions.hpp"

#include <fmt/format.h>
#include <openssl/rand.h>

#include <algorithm>
#include <array>
#include <stdexcept>

#include "abbe/result/try.hpp"

namespace abbe::web {
namespace {

using daemon::ErrorCode;
using daemon::Result;

constexpr std::size_t kMostFailing = 1000;

std::string random_token() {
  std::array<unsigned char, 32> bytes{};
  if (RAND_bytes(bytes.data(), static_cast<int>(bytes.size())) != 1)
    throw std::runtime_error("no random numbers");
  std::string text;
  for (const unsigned char byte : bytes) text += fmt::format("{:02x}", byte);
  return text;
}

}  // namespace

Sessions::Sessions(const std::filesystem::path& users_file, SessionLimits limits,
                   std::function<void(const std::string&)> report)
    : limits_(limits) {
  if (users_file.empty()) return;
  users_.emplace(users_file, std::move(report));
  (void)users_->users();  // reports a fault at the start
}

Result<std::size_t> Sessions::failures_of(const std::string& address, Clock::time_point now) {
  const std::lock_guard lock(mutex_);
  std::erase_if(failures_, [&](const auto& f) { return now - f.second.last >= limits_.pause; });
  const auto found = failures_.find(address);
  const std::size_t count = found == failures_.end() ? 0 : found->second.count;
  if (count >= limits_.failures)
    return daemon::fail(ErrorCode::Refused,
                        fmt::format("too many wrong passwords: wait {} s", limits_.pause.count()));
  return count;
}

Result<WebSession> Sessions::log_in(const std::string& user, const std::string& password,
                                    const std::string& address, Clock::time_point now) {
  if (!possible())
    return daemon::fail(ErrorCode::Refused, "nobody can log in: [web] users names no file");
  const auto before = failures_of(address, now);
  ABBE_TRY(before);
  const auto turn = turns_.wait(address, *before, kPatience);
  if (!turn)
    return daemon::fail(ErrorCode::Io,
                        "many passwords are being checked: try again in some seconds");
  // Others of this address may have failed while this one waited.
  ABBE_TRY(failures_of(address, now));
  const auto users = users_->users();
  ABBE_TRY(users);
  const auto found = find_web_user(**users, user, password);

  const std::lock_guard lock(mutex_);
  if (!found) {
    if (failures_.size() >= kMostFailing)
      failures_.erase(
          std::ranges::min_element(failures_, {}, [](const auto& f) { return f.second.last; }));
    Failures& failures = failures_[address];
    ++failures.count;
    failures.last = now;
    return daemon::fail(ErrorCode::Refused, std::string{kWrong});
  }
  // The failures stay: whoever has one password must not try others without limit.
  remove_ended(now);
  make_place_for(found->name);
  WebSession session{
      .token = random_token(), .csrf = random_token(), .user = found->name, .role = found->role};
  kept_[session.token] = {session, found->hash, now, now};
  return session;
}

std::optional<WebSession> Sessions::find(const std::string& token, Clock::time_point now,
                                         SessionUse use) {
  WebSession session;
  std::string hash;
  {
    const std::lock_guard lock(mutex_);
    remove_ended(now);
    const auto found = kept_.find(token);
    if (found == kept_.end()) return std::nullopt;
    if (use == SessionUse::Request) found->second.used = now;
    session = found->second.session;
    hash = found->second.hash;
  }

  const auto users = users_->users();
  if (!users) return std::nullopt;
  const auto user = std::ranges::find(**users, session.user, &WebUser::name);
  if (user == (*users)->end() || user->role != session.role || user->hash != hash)
    return std::nullopt;
  return session;
}

void Sessions::log_out(const std::string& token) {
  const std::lock_guard lock(mutex_);
  kept_.erase(token);
}

void Sessions::make_place_for(const std::string& user) {
  std::size_t of_user = 0;
  auto oldest = kept_.end();
  for (auto at = kept_.begin(); at != kept_.end(); ++at) {
    if (at->second.session.user != user) continue;
    ++of_user;
    if (oldest == kept_.end() || at->second.begun < oldest->second.begun) oldest = at;
  }
  if (of_user >= limits_.of_one_user) kept_.erase(oldest);
  if (kept_.size() >= limits_.sessions)
    kept_.erase(std::ranges::min_element(kept_, {}, [](const auto& k) { return k.second.used; }));
}

void Sessions::remove_ended(Clock::time_point now) {
  std::erase_if(kept_, [&](const auto& k) {
    return now - k.second.used >= limits_.idle || now - k.second.begun >= limits_.total;
  });
}

}  // namespace abbe::web
