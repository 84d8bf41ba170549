#include "request_rate.hpp"

#include <algorithm>

namespace abbe::web {
namespace {

constexpr std::size_t kMostNetworks = 4096;

}  // namespace

bool RequestRate::take(const std::string& network, Clock::time_point now) {
  const std::lock_guard lock(mutex_);
  if (buckets_.size() >= kMostNetworks) forget_full_ones(now);
  if (buckets_.size() >= kMostNetworks && !buckets_.contains(network)) return false;

  Bucket& bucket = buckets_.try_emplace(network, Bucket{at_once_, now}).first->second;
  const double elapsed_s = std::chrono::duration<double>(now - bucket.at).count();
  bucket.left = std::min(at_once_, bucket.left + per_second_ * elapsed_s);
  bucket.at = now;
  if (bucket.left < 1.0) return false;
  bucket.left -= 1.0;
  return true;
}

void RequestRate::forget_full_ones(Clock::time_point now) {
  std::erase_if(buckets_, [&](const auto& entry) {
    const double elapsed_s = std::chrono::duration<double>(now - entry.second.at).count();
    return entry.second.left + per_second_ * elapsed_s >= at_once_;
  });
}

}  // namespace abbe::web
