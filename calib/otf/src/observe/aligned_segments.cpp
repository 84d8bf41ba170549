#include "abbe/calib/internal/otf/observe/aligned_segments.hpp"

#include <algorithm>
#include <string>
#include <utility>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/otf/observe/observe.hpp"
#include "abbe/result/try.hpp"
#include "observe/observe_aligned.hpp"
#include "observe/off_line_samples.hpp"
#include "observe/off_time_samples.hpp"
#include "samples/unreachable_samples.hpp"

namespace abbe::calib::otf {
namespace {

using KeptSamples = std::vector<TrackerObservation>;

KeptSamples without_aside(std::span<const TrackerObservation> samples,
                          const std::vector<bool>& aside) {
  KeptSamples kept(samples.begin(), samples.end());
  for (std::size_t i = 0; i < aside.size(); ++i) {
    kept[i].valid = kept[i].valid && !aside[i];
  }
  return kept;
}

/// Sets the members of SetAside that state where samples are excluded.
void add_places(SetAside& a, std::span<const TrackerObservation> samples,
                const std::vector<bool>& aside, const AlignedSegments& run) {
  std::size_t in_a_row = 0;
  for (std::size_t i = 0; i < aside.size(); ++i) {
    in_a_row = aside[i] ? in_a_row + 1 : 0;
    if (in_a_row > a.longest) {
      a.longest = in_a_row;
      a.longest_from_s = samples[i + 1 - in_a_row].time_s - samples.front().time_s;
    }
  }

  std::vector<std::size_t> on_leg(run.alignment.leg.back() + 1, 0);
  for (std::size_t b = 0; b < run.series.segments.size(); ++b) {
    const Segment& segment = run.series.segments[b];
    on_leg[run.alignment.leg[b]] += static_cast<std::size_t>(
        std::count(aside.begin() + static_cast<std::ptrdiff_t>(segment.begin_sample),
                   aside.begin() + static_cast<std::ptrdiff_t>(segment.end_sample), true));
  }
  const auto worst = std::max_element(on_leg.begin(), on_leg.end());
  a.worst_leg = static_cast<std::size_t>(worst - on_leg.begin());
  a.on_worst_leg = *worst;
}

std::size_t count_of(const std::vector<bool>& aside) {
  return static_cast<std::size_t>(std::count(aside.begin(), aside.end(), true));
}

class Screening {
 public:
  Screening(std::span<const TrackerObservation> samples, const Machine& machine, const Path& path,
            const Noise& noise, const Options& options)
      : samples_(samples), machine_(machine), path_(path), noise_(noise), options_(options) {}

  [[nodiscard]] Result<AlignedSegments> segments() {
    return make_segments(samples_, options_)
        .and_then([&](SegmentSeries all) { return without_unreachable(std::move(all)); })
        .and_then([&](AlignedSegments run) { return without_off_line(std::move(run)); });
  }

 private:
  Result<AlignedSegments> without_unreachable(SegmentSeries all) {
    aside_ = unreachable_samples(samples_);
    if (aside_.empty()) {
      return aligned(std::move(all));
    }

    Result<AlignedSegments> run = aligned_without_aside();
    if (!run) {
      aside_.clear();
      return aligned(std::move(all));
    }
    found_.unreachable = count_of(aside_);
    return run;
  }

  Result<AlignedSegments> without_off_line(AlignedSegments run) {
    const KeptSamples reachable = aside_.empty() ? KeptSamples{} : without_aside(samples_, aside_);
    const std::span<const TrackerObservation> kept =
        aside_.empty() ? samples_ : std::span<const TrackerObservation>(reachable);
    const OffLine off =
        off_line_samples(kept, run.series, run.alignment, machine_.target_offset_m, path_, noise_);
    const std::vector<std::size_t> off_samples = with_off_time(off.samples, kept, run);

    found_.off_line = off_samples.size();
    found_.noisy_segments = off.segments.size();
    if (!off_samples.empty()) {
      aside_.resize(samples_.size(), false);
      for (const std::size_t i : off_samples) {
        aside_[i] = true;
      }
      Result<AlignedSegments> again = aligned_without_aside();
      if (!again) {
        return again;
      }
      run = *std::move(again);
    }

    for (const OffLine::Noisy& noisy : off.segments) {
      run.series.segments[noisy.segment].noise_factor = noisy.noise_factor;
    }
    if (!aside_.empty()) {
      add_places(found_, samples_, aside_, run);
    }
    found_.of_samples = static_cast<std::size_t>(std::count_if(
        samples_.begin(), samples_.end(), [](const TrackerObservation& s) { return s.valid; }));
    run.series.set_aside = found_;
    return run;
  }

  /// Adds the samples that are wrong along the travel, if this component is used
  /// (Options::encoders).
  [[nodiscard]] std::vector<std::size_t> with_off_time(std::vector<std::size_t> off,
                                                       std::span<const TrackerObservation> samples,
                                                       const AlignedSegments& run) const {
    if (options_.encoders != nullptr) {
      const std::vector<std::size_t> more =
          off_time_samples(samples, run.series, run.alignment, path_, noise_);
      off.insert(off.end(), more.begin(), more.end());
      std::sort(off.begin(), off.end());
      off.erase(std::unique(off.begin(), off.end()), off.end());
    }
    return off;
  }

  Result<AlignedSegments> aligned_without_aside() {
    return make_segments(without_aside(samples_, aside_), options_)
        .and_then([&](SegmentSeries series) {
          series.lost_samples -= count_of(aside_);
          return aligned(std::move(series));
        });
  }

  Result<AlignedSegments> aligned(SegmentSeries series) {
    const Result<void> valid =
        check(noise_).and_then([&] { return check_travel(series, options_); });
    ABBE_TRY(valid);

    Result<Alignment> alignment = align(series, machine_, path_, options_);
    options_.progress = {};  // the first alignment has reported the progress
    ABBE_TRY(alignment);
    return AlignedSegments{std::move(series), *std::move(alignment)};
  }

  std::span<const TrackerObservation> samples_;
  const Machine& machine_;
  const Path& path_;
  const Noise& noise_;
  Options options_;
  std::vector<bool> aside_;  ///< for each sample: true if excluded; empty if none is
  SetAside found_;
};

std::string taken_out_text(const NestVisits& nests) {
  std::string names;
  for (std::size_t n = 0; n < nests.names.size(); ++n) {
    const auto visits = std::count_if(nests.found.begin(), nests.found.end(),
                                      [&](const NestVisit& v) { return v.nest == n; });
    if (visits > 0) {
      names += (names.empty() ? "" : ", ") + message(nests.names[n], " (", visits, ")");
    }
  }
  return "visits of reference nests are not part of the run: " + names;
}

AlignedSegments with_nests(AlignedSegments run, NestVisits nests) {
  run.series.lost_samples -= nests.samples.size();
  run.nests = std::move(nests);
  return run;
}

}  // namespace

Result<AlignedSegments> aligned_segments(std::span<const TrackerObservation> samples,
                                         const Machine& machine, const Path& path,
                                         const Noise& noise, const Options& options) {
  Result<NestVisits> nests = find_nest_visits(samples, options.nests, noise);
  ABBE_TRY(nests);
  const auto with_notes = [&](Error error) {
    if (!nests->found.empty()) {
      error.text += "; " + taken_out_text(*nests);
    }
    for (const std::string& note : nests->notes) {
      error.text += "; " + note;
    }
    return error;
  };
  if (nests->samples.empty()) {
    return Screening(samples, machine, path, noise, options)
        .segments()
        .map([&](AlignedSegments run) { return with_nests(std::move(run), *std::move(nests)); })
        .map_error(with_notes);
  }

  KeptSamples without(samples.begin(), samples.end());
  for (const std::size_t i : nests->samples) {
    without[i].valid = false;
  }
  return Screening(without, machine, path, noise, options)
      .segments()
      .map([&](AlignedSegments run) { return with_nests(std::move(run), *std::move(nests)); })
      .map_error(with_notes);
}

}  // namespace abbe::calib::otf
