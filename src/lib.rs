//! Automatic, aesthetics-driven lighting design with global illumination.
//!
//! From a scene and a look (high-key, low-key, or one's own) to the lights that give the
//! picture that look: their radiance and size, and the value of the background. The method
//! is that of \[PG14\].
//!
//! # Conventions
//!
//! - World space is right-handed, y up, in metres. Radiance is linear Rec.709 in
//!   W·m⁻²·sr⁻¹ per channel.
//! - `wo` points toward the previous vertex, `wi` onward, both away from the surface; local
//!   +z is the shading normal. `f` is a BSDF without cosine.
//! - `pdf_*` is a density, `pmf_*` a probability; the type says the measure.
//! - The renderer works in f32; measuring and optimising in f64.
//! - Same scene, options and seed: the same bytes, whatever the number of threads.
//!
//! # Modules, lowest floor first
//!
//! A module uses only modules above it in this table.
//!
//! | module | what it holds |
//! | --- | --- |
//! | [`math`] | colour, display encoding, frames, densities, warps, distributions, statistics |
//! | [`files`] | what a scene may read, atomic writing, TOML with helpful errors |
//! | [`picture`] | reading the pictures of other programs |
//! | [`embree`] | ray queries |
//! | [`bsdf`] | scattering at surfaces |
//! | [`light`] | light sources that can be resized for free |
//! | [`camera`] | pinhole and thin lens |
//! | [`sampler`] | sequences of sample points |
//! | [`scene`] | geometry, materials, lights: what an integrator asks of a scene |
//! | [`lighting`] | what a picture of a scene varies, and what steers its samples |
//! | [`film`] | contributions to pictures; EXR, PNG |
//! | [`integrator`] | path tracing, bidirectional path tracing |
//! | [`canvas`] | drawings: text, lines, pictures pasted on them |
//! | [`denoise`] | pictures without noise: a regression on features that keeps sums |
//! | [`transport`] | the transport basis: one render from which every lighting follows |
//! | [`variables`] | the free variables, their bounds, scales and starts |
//! | [`objective`] | f_q, its terms, targets and signatures |
//! | [`import`] | scene files: OBJ, MTL, glTF, sidecar; staging |
//! | [`photo`] | photographs as looks, signatures learned from them |
//! | [`optim`] | NLopt's searches, finite differences |
//! | [`export`] | lit scenes for other renderers and modelling programs |
//! | [`audit`] | the run directory, `lights.toml`, what a stored basis says of itself, what an unfinished command has made |
//! | [`design`] | a whole run |
//! | [`figures`] | the tables and figures of \[PG14\] |
//! | [`bench`](mod@bench) | how fast all this is, beside others |
//! | [`report`] | the page of a run, in which its lights can be moved; plots of it |
//! | [`cli`] | the command line |
//!
//! `docs/architecture.md` shows how data goes through them and where to add what,
//! `docs/formats.md` every file that is read or written, and `examples/` how to use the library.
//!
//! # Bibliography
//!
//! - \[Acklam03\] P. Acklam, *An algorithm for computing the inverse normal cumulative
//!   distribution function*, 2003.
//! - \[Bitterli16\] B. Bitterli et al., *Nonlinearly Weighted First-order Regression for
//!   Denoising Monte Carlo Renderings*, CGF 35(4), 2016.
//! - \[BT709\] Recommendation ITU-R BT.709-6, 2015.
//! - \[Burley20\] B. Burley, *Practical Hash-based Owen Scrambling*, JCGT 9(4), 2020.
//! - \[CIE15\] CIE 15:2018, *Colorimetry*.
//! - \[Clarberg08\] P. Clarberg, *Fast Equal-Area Mapping of the (Hemi)Sphere using SIMD*, Journal of
//!   Graphics Tools 13(3), 2008.
//! - \[DLMF\] NIST Digital Library of Mathematical Functions, <https://dlmf.nist.gov>.
//! - \[Duff17\] T. Duff et al., *Building an Orthonormal Basis, Revisited*, JCGT 6(1),
//!   2017.
//! - \[Dupuy23\] J. Dupuy, A. Benyoub, *Sampling Visible GGX Normals with Spherical Caps*,
//!   CGF 42(8), 2023.
//! - \[Cochran77\] W. G. Cochran, *Sampling Techniques*, third edition, Wiley 1977.
//! - \[Efron82\] B. Efron, *The Jackknife, the Bootstrap and Other Resampling Plans*, SIAM
//!   1982.
//! - \[EGamut\] FilmLight, *E-Gamut*, the working space of Baselight.
//! - \[Ericson04\] C. Ericson, *Real-Time Collision Detection*, Morgan Kaufmann 2004.
//! - \[Gablonsky01\] J. M. Gablonsky, C. T. Kelley, *A Locally-Biased Form of the DIRECT
//!   Algorithm*, Journal of Global Optimization 21, 2001.
//! - \[H273\] Recommendation ITU-T H.273, *Coding-independent code points*, 2021.
//! - \[Georgiev12\] I. Georgiev et al., *Light Transport Simulation with Vertex Connection
//!   and Merging*, ACM TOG 31(6), 2012.
//! - \[Grittmann22\] P. Grittmann et al., *Efficiency-Aware Multiple Importance Sampling for Bidirectional Rendering
//!   Algorithms*, ACM TOG 41(4), 2022.
//! - \[Haimes71\] Y. Haimes, L. Lasdon, D. Wismer, *On a Bicriterion Formulation of the Problems of Integrated System
//!   Identification and System Optimization*, IEEE Trans. SMC 1(3), 1971.
//! - \[He15\] Z. He, X. Wang, *On the Convergence Rate of Randomized Quasi-Monte Carlo for
//!   Discontinuous Functions*, SIAM J. Numer. Anal. 53(5), 2015.
//! - \[Heitz16\] E. Heitz, J. Hanika, E. d'Eon, C. Dachsbacher, *Multiple-Scattering
//!   Microfacet BSDFs with the Smith Model*, ACM TOG 35(4), 2016.
//! - \[Heitz18\] E. Heitz, *Sampling the GGX Distribution of Visible Normals*, JCGT 7(4),
//!   2018.
//! - \[Heitz19\] E. Heitz, *A Low-Distortion Map Between Triangle and Square*, HAL
//!   hal-02073696, 2019.
//! - \[Hill18\] S. Hill, *A Multi-Faceted Exploration*, part 3, self-shadow.com, 2018.
//! - \[Hunter15\] F. Hunter, S. Biver, P. Fuqua, *Light: Science & Magic*, 5th ed., Focal
//!   Press 2015.
//! - \[ICC\] International Color Consortium, *ICC.1:2022*.
//! - \[IEC61966\] IEC 61966-2-1:1999, *Default RGB colour space: sRGB*.
//! - \[ISO21496\] ISO 21496-1:2025, *Gain map metadata for image conversion*.
//! - \[ISO12232\] ISO 12232:2006, *Photography: Digital still cameras: Determination of exposure index*.
//! - \[Kajiya86\] J. Kajiya, *The Rendering Equation*, SIGGRAPH 1986.
//! - \[Kelemen01\] C. Kelemen, L. Szirmay-Kalos, *A Microfacet Based Coupled Specular-Matte
//!   BRDF Model with Importance Sampling*, Eurographics short presentations, 2001.
//! - \[Kensler13\] A. Kensler, *Correlated Multi-Jittered Sampling*, Pixar TM 13-01, 2013.
//! - \[Khronos24\] Khronos Group, *PBR Neutral Tone Mapper*, 2024.
//! - \[Kolb95\] C. Kolb, D. Mitchell, P. Hanrahan, *A Realistic Camera Model for Computer
//!   Graphics*, SIGGRAPH 1995.
//! - \[Kraft88\] D. Kraft, *A Software Package for Sequential Quadratic Programming*, DFVLR-FB
//!   88-28, 1988.
//! - \[Krystek85\] M. Krystek, *An algorithm to calculate correlated colour temperature*, Color Research and
//!   Application 10(1), 1985.
//! - \[Kulla17\] C. Kulla, A. Conty, *Revisiting Physically Based Shading at Imageworks*,
//!   SIGGRAPH course Physically Based Shading in Theory and Practice, 2017.
//! - \[Kutz21\] P. Kutz, M. Hašan, D. Edmondson, *Novel Aspects of the Adobe Standard Material*,
//!   2021.
//! - \[Lagarde14\] S. Lagarde, C. de Rousiers, *Moving Frostbite to Physically Based Rendering*,
//!   SIGGRAPH course Physically Based Shading in Theory and Practice, 2014.
//! - \[Leone61\] F. Leone, L. Nelson, R. Nottingham, *The Folded Normal Distribution*,
//!   Technometrics 3(4), 1961.
//! - \[Lindbloom\] B. Lindbloom, *RGB/XYZ Matrices*, *Chromatic Adaptation*.
//! - \[Lottes16\] T. Lottes, *Advanced Techniques and Optimization of HDR Color Pipelines*, GDC
//!   2016.
//! - \[Meisters75\] G. Meisters, *Polygons have ears*, Amer. Math. Monthly 82, 1975.
//! - \[Moon14\] B. Moon, N. Carr, S. Yoon, *Adaptive Rendering Based on Weighted Local
//!   Regression*, ACM TOG 33(5), 2014.
//! - \[More11\] J. Moré, S. Wild, *Estimating Computational Noise*, SIAM J. Sci. Comput.
//!   33(3), 2011.
//! - \[More12\] J. Moré, S. Wild, *Estimating Derivatives of Noisy Simulations*, ACM TOMS
//!   38(3), 2012.
//! - \[MT97\] T. Möller, B. Trumbore, *Fast, Minimum Storage Ray/Triangle Intersection*,
//!   JGT 2(1), 1997.
//! - \[Nocedal06\] J. Nocedal, S. Wright, *Numerical Optimization*, second edition, Springer 2006.
//! - \[Nocedal80\] J. Nocedal, *Updating Quasi-Newton Matrices with Limited Storage*, Math.
//!   Comp. 35, 1980.
//! - \[OpenEXR\] *OpenEXR File Layout*, *Technical Introduction to OpenEXR*.
//! - \[PBRT3\] M. Pharr, W. Jakob, G. Humphreys, *Physically Based Rendering*, 3rd ed.,
//!   2016.
//! - \[PBRT4\] M. Pharr, W. Jakob, G. Humphreys, *Physically Based Rendering*, 4th ed.,
//!   2023.
//! - \[Ohno14\] Y. Ohno, *Practical Use and Calculation of CCT and Duv*, LEUKOS 10(1), 2014.
//! - \[Ottosson20\] B. Ottosson, *A perceptual color space for image processing*, bottosson.github.io, 2020.
//! - \[PG14\] *Automatic Aesthetics-based Lighting Design with Global Illumination*,
//!   Pacific Graphics short papers, 2014.
//! - \[Peyre19\] G. Peyré, M. Cuturi, *Computational Optimal Transport*, Found. Trends Mach.
//!   Learn. 11(5-6), 2019.
//! - \[PNG3\] W3C, *Portable Network Graphics*, 3rd ed., 2025.
//! - \[Radiance\] G. Ward, *Radiance File Formats*.
//! - \[Roberts18\] M. Roberts, *The Unreasonable Effectiveness of Quasirandom Sequences*,
//!   2018.
//! - \[Rousselle12\] F. Rousselle, C. Knaus, M. Zwicker, *Adaptive Rendering with Non-Local
//!   Means Filtering*, ACM TOG 31(6), 2012.
//! - \[Rousselle13\] F. Rousselle, M. Manzi, M. Zwicker, *Robust Denoising using Feature and
//!   Color Information*, CGF 32(7), 2013.
//! - \[Schlick94\] C. Schlick, *An Inexpensive BRDF Model for Physically-based Rendering*,
//!   CGF 13(3), 1994.
//! - \[Schucany71\] W. Schucany, H. Gray, D. Owen, *On Bias Reduction in Estimation*, JASA
//!   66(335), 1971.
//! - \[Shirley97\] P. Shirley, K. Chiu, *A Low Distortion Map Between Disk and Square*, JGT
//!   2(3), 1997.
//! - \[Sobotka17\] T. J. Sobotka, *Filmic Blender*, an OpenColorIO configuration, 2017.
//! - \[Sobotka23\] T. J. Sobotka, *SB2383 Configuration Generation*, AgX, 2023.
//! - \[Steele14\] G. Steele, D. Lea, C. Flood, *Fast Splittable Pseudorandom Number
//!   Generators*, OOPSLA 2014.
//! - \[T81\] Recommendation ITU-T T.81, JPEG, 1992.
//! - \[TGA2\] *Truevision TGA File Format Specification*, version 2.0, 1991.
//! - \[Thompson86\] I. Thompson, A. Barnett, *Coulomb and Bessel Functions of Complex
//!   Arguments and Order*, J. Comput. Phys. 64, 1986 (the modified Lentz algorithm).
//! - \[Thurmer98\] G. Thürmer, C. Wüthrich, *Computing Vertex Normals from Polygonal
//!   Facets*, JGT 3(1), 1998.
//! - \[TIFF6\] Adobe, *TIFF*, revision 6.0, 1992.
//! - \[TIFFTN2\] Adobe, *TIFF Technical Note 2: JPEG*, 1995.
//! - \[vanAntwerpen11\] D. van Antwerpen, *Recursive MIS Computation for Streaming BDPT on
//!   the GPU*, TU Delft 2011.
//! - \[Veach97\] E. Veach, *Robust Monte Carlo Methods for Light Transport Simulation*,
//!   Stanford 1997.
//! - \[Wallace59\] D. Wallace, *Bounds on Normal Approximations to Student's and the
//!   Chi-Square Distributions*, Ann. Math. Stat. 30, 1959.
//! - \[Walter07\] B. Walter et al., *Microfacet Models for Refraction through Rough
//!   Surfaces*, EGSR 2007.
//! - \[WebP\] Google, *WebP Container Specification*.
//! - \[Welch47\] B. Welch, *The Generalization of "Student's" Problem when Several Different
//!   Population Variances are Involved*, Biometrika 34, 1947.
//! - \[Welford62\] B. Welford, *Note on a Method for Calculating Corrected Sums of Squares
//!   and Products*, Technometrics 4(3), 1962.
//! - \[Zhou23\] Z. E. Zhou, *AgX LUT Gen*, 2023.

pub mod audit;
pub mod bench;
pub mod bsdf;
pub mod camera;
pub mod canvas;
pub mod cli;
pub mod denoise;
pub mod design;
pub mod embree;
pub mod export;
pub mod figures;
pub mod files;
pub mod film;
pub mod import;
pub mod integrator;
pub mod light;
pub mod lighting;
pub mod math;
pub mod objective;
pub mod optim;
pub mod photo;
pub mod picture;
pub mod report;
pub mod sampler;
pub mod scene;
pub mod transport;
pub mod variables;

#[cfg(test)]
mod tests;
