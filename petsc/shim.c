/* Wrappers for parts of PETSc and MPI that Rust cannot use: communicators (a number or a pointer), macros, the values of enums. */
#include <petscksp.h>
#if defined(__GLIBC__)
  #include <malloc.h>
#endif
#include <signal.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

_Static_assert(sizeof(PetscScalar) == sizeof(double) && sizeof(PetscReal) == sizeof(double), "PetscScalar is not double");
#if defined(PETSC_USE_64BIT_INDICES)
_Static_assert(sizeof(PetscInt) == 8, "PetscInt is not int64_t");
#else
_Static_assert(sizeof(PetscInt) == 4, "PetscInt is not int32_t");
#endif
_Static_assert(sizeof(PetscLogDouble) == sizeof(double), "PetscLogDouble is not double");
_Static_assert(sizeof(PetscErrorCode) == sizeof(int), "PetscErrorCode is not int");
_Static_assert(sizeof(Vec) == sizeof(void *) && sizeof(Mat) == sizeof(void *) && sizeof(KSP) == sizeof(void *), "handles");

/* Votes have their own communicator, so that they do not match messages of PETSc. */
static MPI_Comm votes = MPI_COMM_NULL;
/* The process that prints messages common to all. */
static volatile pid_t teller = 0;

/* Ctrl-C reaches the processes as SIGTERM from mpiexec. Process 0 prints a message; no process stays in a call that waits for others.
 * mpiexec of Open MPI 4 kills all others (SIGKILL) as soon as one has ended: they wait until process 0 has had time to print. */
static void interrupted(int number)
{
  static const char     said[] = "error: the job was interrupted by a signal; what was saved before stays\n";
  const struct timespec wait   = {.tv_sec = 1};

  if (getpid() == teller) (void)!write(STDERR_FILENO, said, strlen(said));
  else (void)nanosleep(&wait, NULL);
  _exit(128 + number);
}

int shim_start(const char *options)
{
  int              rank;
  struct sigaction action = {.sa_handler = interrupted};

  /* Errors come back as codes: no abort, nothing on stderr. */
  PetscCall(PetscInitializeNoArguments());
  PetscCall(PetscPushErrorHandler(PetscReturnErrorHandler, NULL));
  if (MPI_Comm_dup(PETSC_COMM_WORLD, &votes)) return PETSC_ERR_MPI;
  MPI_Comm_rank(PETSC_COMM_WORLD, &rank);
  if (rank == 0) teller = getpid();
  sigemptyset(&action.sa_mask);
  if (sigaction(SIGINT, &action, NULL) || sigaction(SIGTERM, &action, NULL)) return PETSC_ERR_SYS;
  return PetscOptionsInsertString(NULL, options);
}
/* Open MPI makes malloc keep all freed memory, in pieces too small for large blocks. */
void shim_trim(void)
{
#if defined(__GLIBC__)
  malloc_trim(0);
#endif
}
int shim_finish(void)
{
  MPI_Comm_free(&votes);
  return PetscFinalize();
}
void shim_abort(int code) { MPI_Abort(MPI_COMM_WORLD, code); }
void shim_world(int *rank, int *size)
{
  MPI_Comm_rank(PETSC_COMM_WORLD, rank);
  MPI_Comm_size(PETSC_COMM_WORLD, size);
}

/* The minimum of `own` over all processes. A process with `own` < `limit` waits for the others at most `patience` seconds. */
int shim_vote(int own, int limit, double patience, int *smallest, int *late)
{
  MPI_Request request;
  int         done = 0;
  double      begun = MPI_Wtime();

  *late = 0;
  if (MPI_Iallreduce(&own, smallest, 1, MPI_INT, MPI_MIN, votes, &request)) return PETSC_ERR_MPI;
  if (own >= limit) return MPI_Wait(&request, MPI_STATUS_IGNORE) ? PETSC_ERR_MPI : 0;
  while (1) {
    if (MPI_Test(&request, &done, MPI_STATUS_IGNORE)) return PETSC_ERR_MPI;
    if (done) return 0;
    if (MPI_Wtime() - begun > patience) {
      *late = 1;
      return 0;
    }
    usleep(1000);
  }
}
int shim_broadcast(char *text, int length, int root) { return MPI_Bcast(text, length, MPI_CHAR, root, votes) ? PETSC_ERR_MPI : 0; }
int shim_sum(double *v, int n) { return MPI_Allreduce(MPI_IN_PLACE, v, n, MPI_DOUBLE, MPI_SUM, PETSC_COMM_WORLD) ? PETSC_ERR_MPI : 0; }
int shim_max(double *v, int n) { return MPI_Allreduce(MPI_IN_PLACE, v, n, MPI_DOUBLE, MPI_MAX, PETSC_COMM_WORLD) ? PETSC_ERR_MPI : 0; }
/* Bytes from one process to another, in messages of at most 64 MB. */
enum { MESSAGE = 1 << 26 };
int shim_send(const char *bytes, long long n, int to)
{
  for (long long at = 0; at < n; at += MESSAGE) {
    if (MPI_Send(bytes + at, n - at < MESSAGE ? (int)(n - at) : MESSAGE, MPI_CHAR, to, 0, votes)) return PETSC_ERR_MPI;
  }
  return 0;
}
int shim_receive(char *bytes, long long n, int from)
{
  for (long long at = 0; at < n; at += MESSAGE) {
    if (MPI_Recv(bytes + at, n - at < MESSAGE ? (int)(n - at) : MESSAGE, MPI_CHAR, from, 0, votes, MPI_STATUS_IGNORE)) return PETSC_ERR_MPI;
  }
  return 0;
}
/* The sums of `own` over the processes before this one, and over all. */
int shim_offset(long long own, long long *before, long long *total)
{
  int rank;

  MPI_Comm_rank(PETSC_COMM_WORLD, &rank);
  if (MPI_Exscan(&own, before, 1, MPI_LONG_LONG, MPI_SUM, PETSC_COMM_WORLD)) return PETSC_ERR_MPI;
  if (rank == 0) *before = 0;
  return MPI_Allreduce(&own, total, 1, MPI_LONG_LONG, MPI_SUM, PETSC_COMM_WORLD) ? PETSC_ERR_MPI : 0;
}
/* Rows of `width` numbers from the processes that own them. */
int shim_fetch(PetscInt width, PetscInt own, const double *values, PetscInt count, const PetscInt *rows, double *out)
{
  Vec        from, to;
  IS         which;
  VecScatter scatter;

  PetscCall(VecCreateMPIWithArray(PETSC_COMM_WORLD, width, own * width, PETSC_DETERMINE, values, &from));
  PetscCall(VecCreateSeqWithArray(PETSC_COMM_SELF, width, count * width, out, &to));
  PetscCall(ISCreateBlock(PETSC_COMM_SELF, width, count, rows, PETSC_COPY_VALUES, &which));
  PetscCall(VecScatterCreate(from, which, to, NULL, &scatter));
  PetscCall(VecScatterBegin(scatter, from, to, INSERT_VALUES, SCATTER_FORWARD));
  PetscCall(VecScatterEnd(scatter, from, to, INSERT_VALUES, SCATTER_FORWARD));
  PetscCall(VecScatterDestroy(&scatter));
  PetscCall(ISDestroy(&which));
  PetscCall(VecDestroy(&to));
  return VecDestroy(&from);
}

int shim_vector(PetscInt local, PetscInt block, Vec *v)
{
  PetscCall(VecCreateMPI(PETSC_COMM_WORLD, local, PETSC_DETERMINE, v));
  return VecSetBlockSize(*v, block);
}
/* A square matrix by rows, each filled by its owner; `own` and `other` count the blocks of each block row in columns of this process
   and of others. */
int shim_matrix(PetscInt local, PetscInt block, const PetscInt own[], const PetscInt other[], Mat *a)
{
  PetscCall(MatCreate(PETSC_COMM_WORLD, a));
  PetscCall(MatSetSizes(*a, local, local, PETSC_DETERMINE, PETSC_DETERMINE));
  PetscCall(MatSetBlockSize(*a, block));
  PetscCall(MatSetType(*a, MATAIJ));
  PetscCall(MatXAIJSetPreallocation(*a, block, own, other, NULL, NULL));
  PetscCall(MatSetOption(*a, MAT_NO_OFF_PROC_ENTRIES, PETSC_TRUE));
  return MatSetOption(*a, MAT_KEEP_NONZERO_PATTERN, PETSC_TRUE);
}
int shim_add_block_row(Mat a, PetscInt row, PetscInt n, const PetscInt cols[], const double values[])
{
  return MatSetValuesBlocked(a, 1, &row, n, cols, values, ADD_VALUES);
}
int shim_add_row(Mat a, PetscInt row, PetscInt n, const PetscInt cols[], const double values[])
{
  return MatSetValues(a, 1, &row, n, cols, values, ADD_VALUES);
}
int shim_assemble(Mat a)
{
  PetscCall(MatAssemblyBegin(a, MAT_FINAL_ASSEMBLY));
  return MatAssemblyEnd(a, MAT_FINAL_ASSEMBLY);
}
/* The submatrix of some rows and the same columns; each process gives its own rows, in increasing order. `again`: into the same matrix. */
int shim_among(Mat a, PetscInt n, const PetscInt rows[], int again, Mat *part)
{
  IS is;

  PetscCall(ISCreateGeneral(PETSC_COMM_WORLD, n, rows, PETSC_COPY_VALUES, &is));
  PetscCall(MatCreateSubMatrix(a, is, is, again ? MAT_REUSE_MATRIX : MAT_INITIAL_MATRIX, part));
  return ISDestroy(&is);
}
int shim_replace_row(Mat a, PetscInt row, PetscInt n, const PetscInt cols[], const double values[])
{
  return MatSetValues(a, 1, &row, n, cols, values, INSERT_VALUES);
}
/* a - b for matrices of the same pattern. */
int shim_subtract(Mat a, Mat b) { return MatAXPY(a, -1.0, b, SAME_NONZERO_PATTERN); }
int shim_triple(Mat a, Mat p, int again, Mat *product) { return MatPtAP(a, p, again ? MAT_REUSE_MATRIX : MAT_INITIAL_MATRIX, 2.0, product); }
int shim_definite(Mat a) { return MatSetOption(a, MAT_SPD, PETSC_TRUE); }
int shim_hold(Mat a, PetscInt n, const PetscInt rows[], double diagonal) { return MatZeroRowsColumns(a, n, rows, diagonal, NULL, NULL); }
int shim_both(Mat a, Mat b, Mat *sum)
{
  Mat parts[2] = {a, b};
  return MatCreateComposite(PETSC_COMM_WORLD, 2, parts, sum);
}
/* The near-kernel from `count` vectors of `local` entries, one after another; vectors that depend on previous ones are left out. */
int shim_near_kernel(Mat a, PetscInt local, PetscInt block, int count, const double *values)
{
  Vec          v[6] = {NULL};
  MatNullSpace kernel;
  int          kept = 0;

  for (int k = 0; k < count && k < 6; k++) {
    PetscScalar *own;
    PetscReal    before, after;

    PetscCall(shim_vector(local, block, &v[kept]));
    PetscCall(VecGetArrayWrite(v[kept], &own));
    PetscCall(PetscArraycpy(own, values + (size_t)k * local, local));
    PetscCall(VecRestoreArrayWrite(v[kept], &own));
    PetscCall(VecNorm(v[kept], NORM_2, &before));
    for (int twice = 0; twice < 2; twice++) {
      for (int i = 0; i < kept; i++) {
        PetscScalar along;
        PetscCall(VecDot(v[kept], v[i], &along));
        PetscCall(VecAXPY(v[kept], -along, v[i]));
      }
    }
    PetscCall(VecNorm(v[kept], NORM_2, &after));
    if (after > 1e-8 * before) {
      PetscCall(VecScale(v[kept], 1.0 / after));
      kept++;
    } else PetscCall(VecDestroy(&v[kept]));
  }
  PetscCall(MatNullSpaceCreate(PETSC_COMM_WORLD, PETSC_FALSE, kept, v, &kernel));
  for (int i = 0; i < kept; i++) PetscCall(VecDestroy(&v[i]));
  PetscCall(MatSetNearNullSpace(a, kernel));
  return MatNullSpaceDestroy(&kernel);
}

static int eliminate(Mat a, Mat factor, PetscInt n, const PetscInt rows[], double schur[])
{
  IS             is;
  Mat            s;
  MatFactorInfo  info;
  MatFactorError failure;

  PetscCall(ISCreateGeneral(PETSC_COMM_WORLD, n, rows, PETSC_COPY_VALUES, &is));
  PetscCall(MatFactorSetSchurIS(factor, is));
  PetscCall(ISDestroy(&is));
  /* MUMPS fills one triangle only, and not the same one on one process as on several. */
  PetscCall(MatFactorGetSchurComplement(factor, &s, NULL));
  PetscCall(MatZeroEntries(s));
  PetscCall(MatFactorInfoInitialize(&info));
  PetscCall(MatCholeskyFactorSymbolic(factor, a, NULL, &info));
  PetscCall(MatCholeskyFactorNumeric(factor, a, &info));
  PetscCall(MatFactorGetError(factor, &failure));
  if (failure == MAT_FACTOR_OUTMEMORY) return PETSC_ERR_MEM;
  if (failure != MAT_FACTOR_NOERROR) return PETSC_ERR_MAT_CH_ZRPVT;
  if (n > 0) {
    const PetscScalar *v;
    PetscInt           lda;

    PetscCall(MatDenseGetLDA(s, &lda));
    PetscCall(MatDenseGetArrayRead(s, &v));
    for (size_t i = 0; i < (size_t)n; i++) {
      for (size_t j = 0; j <= i; j++) {
        double one = v[i * lda + j], other = v[j * lda + i];
        schur[i * n + j] = schur[j * n + i] = one != 0.0 ? one : other;
      }
    }
    PetscCall(MatDenseRestoreArrayRead(s, &v));
  }
  return MatFactorRestoreSchurComplement(factor, &s, MAT_FACTOR_SCHUR_UNFACTORED);
}

/* The symmetric Schur complement on n rows given by process 0, stored on process 0: MUMPS eliminates all other rows, then its factor is
   freed. */
int shim_eliminate(Mat a, PetscInt n, const PetscInt rows[], double schur[])
{
  Mat factor;
  int code;

  PetscCall(MatGetFactor(a, "mumps", MAT_FACTOR_CHOLESKY, &factor));
  code = eliminate(a, factor, n, rows, schur);
  PetscCall(MatDestroy(&factor));
  return code;
}

/* An option, unless it is given already. */
int shim_default(const char *name, const char *value)
{
  PetscBool given;

  PetscCall(PetscOptionsHasName(NULL, NULL, name, &given));
  return given ? 0 : PetscOptionsSetValue(NULL, name, value);
}
int shim_solver(KSP *k)
{
  PetscCall(KSPCreate(PETSC_COMM_WORLD, k));
  return KSPSetFromOptions(*k);
}
/* Smooths the finest level of multigrid node by node: a node on the verge of slip has one stiff direction, perpendicular to its force and
   along no axis. Blocks of coarse levels may be singular and are smoothed by PETSc's default. */
static int smooth_nodes(KSP k)
{
  PC        pc;
  KSP       smoother;
  PetscInt  levels;
  PetscBool is;

  PetscCall(PetscOptionsHasName(NULL, NULL, "-mg_levels_pc_type", &is));
  if (is) return 0;
  PetscCall(KSPGetPC(k, &pc));
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCGAMG, &is));
  if (!is) return 0;
  PetscCall(PCMGGetLevels(pc, &levels));
  if (levels < 2) return 0;
  PetscCall(PCMGGetSmoother(pc, levels - 1, &smoother));
  PetscCall(KSPGetPC(smoother, &pc));
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCPBJACOBI, &is));
  if (is) return 0;
  PetscCall(PCSetType(pc, PCPBJACOBI));
  /* Eigenvalue bounds estimated for another smoother do not hold for this one. */
  PetscCall(PetscObjectTypeCompare((PetscObject)smoother, KSPCHEBYSHEV, &is));
  if (is) PetscCall(KSPChebyshevEstEigSet(smoother, PETSC_DECIDE, PETSC_DECIDE, PETSC_DECIDE, PETSC_DECIDE));
  return KSPSetUp(smoother);
}
int shim_operators(KSP k, Mat a, Mat p)
{
  PetscCall(KSPSetOperators(k, a, p));
  PetscCall(KSPSetUp(k));
  return smooth_nodes(k);
}
/* Whether the preconditioner is GAMG with aggregates that are reused when the matrix changes. */
int shim_multigrid(KSP k, int *is)
{
  PC        pc;
  PetscBool gamg, stays = PETSC_FALSE;

  PetscCall(KSPGetPC(k, &pc));
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCGAMG, &gamg));
  PetscCall(PetscOptionsGetBool(NULL, NULL, "-pc_gamg_reuse_interpolation", &stays, NULL));
  *is = gamg && stays;
  return 0;
}
/* From an existing hierarchy: the given rows of the interpolation to the finest level, and a copy of the matrix of the level below; NULL if
   there is only one level. The data that PETSc keeps to recompute that matrix are freed: on several processes they take more memory than
   the matrix of the finest level. */
int shim_hierarchy(KSP k, PetscInt n, const PetscInt rows[], Mat *interpolation, Mat *coarse)
{
  PC       pc;
  KSP      smoother;
  IS       is;
  Mat      p, c;
  PetscInt levels;

  *interpolation = *coarse = NULL;
  PetscCall(KSPGetPC(k, &pc));
  PetscCall(PCMGGetLevels(pc, &levels));
  if (levels < 2) return 0;
  PetscCall(PCMGGetInterpolation(pc, levels - 1, &p));
  PetscCall(PCMGGetSmoother(pc, levels - 2, &smoother));
  PetscCall(KSPGetOperators(smoother, &c, NULL));
  PetscCall(MatProductClear(c));
  PetscCall(MatProductClear(p));
  PetscCall(ISCreateGeneral(PETSC_COMM_WORLD, n, rows, PETSC_COPY_VALUES, &is));
  PetscCall(MatCreateSubMatrix(p, is, NULL, MAT_INITIAL_MATRIX, interpolation));
  PetscCall(ISDestroy(&is));
  return MatDuplicate(c, MAT_COPY_VALUES, coarse);
}
/* Updates the hierarchy to new operators: `coarse` + `change` is the matrix of the level below the finest, from which those of coarser
   levels are computed. GAMG's own setup is not called again. */
int shim_update(KSP k, Mat a, Mat p, Mat coarse, Mat change, int again)
{
  PC       pc;
  KSP      smoother;
  Mat      above, own;
  PetscInt levels;

  PetscCall(KSPSetOperators(k, a, p));
  PetscCall(KSPSetReusePreconditioner(k, PETSC_TRUE));
  PetscCall(KSPGetPC(k, &pc));
  PetscCall(PCMGGetLevels(pc, &levels));
  PetscCall(PCMGGetSmoother(pc, levels - 1, &smoother));
  PetscCall(KSPSetOperators(smoother, a, p));
  PetscCall(PCMGSetResidual(pc, levels - 1, PCMGResidualDefault, a));
  PetscCall(PCMGGetSmoother(pc, levels - 2, &smoother));
  PetscCall(KSPGetOperators(smoother, &own, NULL));
  PetscCall(MatCopy(coarse, own, SAME_NONZERO_PATTERN));
  PetscCall(MatAXPY(own, 1.0, change, SUBSET_NONZERO_PATTERN));
  PetscCall(KSPSetOperators(smoother, own, own));
  for (PetscInt l = levels - 3; l >= 0; l--) {
    Mat interpolation;

    above = own;
    PetscCall(PCMGGetInterpolation(pc, l + 1, &interpolation));
    PetscCall(PCMGGetSmoother(pc, l, &smoother));
    if (again) {
      PetscCall(KSPGetOperators(smoother, &own, NULL));
      PetscCall(MatPtAP(above, interpolation, MAT_REUSE_MATRIX, 2.0, &own));
      PetscCall(KSPSetOperators(smoother, own, own));
      continue;
    }
    /* Where GAMG has moved a level to fewer processes, its matrix cannot be reused as the result of MatPtAP. */
    PetscCall(MatPtAP(above, interpolation, MAT_INITIAL_MATRIX, 2.0, &own));
    PetscCall(KSPSetOperators(smoother, own, own));
    if (l > 0) PetscCall(PCMGSetResidual(pc, l, PCMGResidualDefault, own));
    PetscCall(PetscObjectDereference((PetscObject)own));
  }
  return 0;
}
int shim_solve(KSP k, Vec b, Vec x, double tolerance, PetscInt most, PetscInt *iterations, double *residual, int *reason)
{
  KSPConvergedReason why;

  PetscCall(KSPSetTolerances(k, tolerance, 1e-300, PETSC_DEFAULT, most));
  PetscCall(KSPSolve(k, b, x));
  PetscCall(KSPGetIterationNumber(k, iterations));
  PetscCall(KSPGetResidualNorm(k, residual));
  PetscCall(KSPGetConvergedReason(k, &why));
  /* The limit of iterations leaves an approximate solution, other reasons for divergence do not. */
  *reason = why == KSP_DIVERGED_ITS ? 0 : (int)why;
  return 0;
}
