#pragma once
/// Segments of a run and their alignment, without samples that do not belong to the target on its
/// path. Samples are excluded in two steps. If no sample is excluded and no segment is noisy, the
/// segments are those of make_segments().
///
/// Before the alignment, unreachable samples are excluded. The run is divided where the target
/// would have moved, from one sample to the next, further than
///     1 mm + 3 s n
/// s: travel per sample, the larger of the upper quartile of the run and the median over the eight
/// samples before or after, but at most ten times the former; n: number of sample periods, more
/// than 1 after a beam break. Of the parts, the sequence that follows one another within this limit
/// and has the most samples is kept. If the kept parts do not fit the path, or are less than four
/// fifths of the run, nothing is excluded in this step.
///
/// After the alignment, samples off the line are excluded. A segment is suspicious if its samples
/// deviate in one direction across the travel by five standard deviations from their median, or if
/// its mean deviates by as much from the means before and after. The segment and its two neighbours
/// are then compared with a straight line over five segments. The slope of the line is that of
/// repeated medians, from the medians of 15 parts, so that a third of the samples may be wrong. A
/// sample is excluded if its distance from this line is more than
///     7 max(1, f, g) sigma
/// sigma: stated for one sample; f: 1.4826 times the median absolute deviation of the samples from
/// the median of their segment, in units of sigma, median over all segments; g: as f, for the
/// samples around this line. With normal noise one sample in 4e11 exceeds this limit. If
/// differences of successive samples in a segment have more than three times max(1, f) sigma, this
/// factor increases the uncertainty of its mean (Segment::noise_factor).
///
/// With Options::encoders, samples off the line along the travel are excluded, too. The distance
/// along the leg of a sample is compared, with the same limit, with a line against time: repeated
/// medians through the 14 samples around it. Segments whose speed differs from that of their leg by
/// more than 2 % are not tested.
///
/// Not found: a fault longer than about two segments whose beginning and end the target could
/// reach; without encoders, errors along the direction of travel.

#include "abbe/calib/otf/observe/alignment.hpp"
#include "abbe/calib/otf/observe/segments.hpp"
#include "abbe/calib/otf/samples/nest_visits.hpp"

namespace abbe::calib::otf {

struct AlignedSegments {
  SegmentSeries series;
  Alignment alignment;
  NestVisits nests{};  ///< their samples are not in the segments
};
/// Computes segments and alignment. Samples at reference nests (nest_visits.hpp) are removed first.
/// Errors of find_nest_visits(), make_segments(), check(Noise) and align(); BadInput if a segment
/// travels further than twice Options::corner_m. Pure.
[[nodiscard]] Result<AlignedSegments> aligned_segments(std::span<const TrackerObservation>,
                                                       const Machine&, const Path&, const Noise&,
                                                       const Options&);

}  // namespace abbe::calib::otf
