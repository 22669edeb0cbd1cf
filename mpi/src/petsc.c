/* Conjugate gradients with algebraic multigrid of PETSc, for petsc.rs.

   All functions are collective over MPI_COMM_WORLD, and return 0 or a number of an error of PETSc, whose text
   variational_petsc_message holds. */

#include <petscksp.h>

struct solver {
    Mat matrix;
    KSP ksp;
    Vec load, solution;
};

#if !defined(PETSC_CALL_EXISTS) && PETSC_VERSION_LT(3, 17, 0)
#define PetscCall(call)                                                                                                 \
    do {                                                                                                                \
        PetscErrorCode error = (call);                                                                                  \
        CHKERRQ(error);                                                                                                 \
    } while (0)
#endif

#if defined(PETSC_USE_COMPLEX) || !defined(PETSC_USE_REAL_DOUBLE)
#error "PETSc was built for other numbers than real ones of 64 bits: install the real one (Debian: libpetsc-real-dev)"
#endif

static char message[1024];

/* Keeps the text of the first error, and lets the functions return. */
static PetscErrorCode keep(MPI_Comm comm, int line, const char *function, const char *file, PetscErrorCode code,
                           PetscErrorType type, const char *text, void *context) {
    (void)comm, (void)context;
    if (type == PETSC_ERROR_INITIAL)
        snprintf(message, sizeof message, "%s (%s, %s:%d)", text ? text : "no text", function, file, line);
    return code;
}

const char *variational_petsc_message(void) { return message; }

/* Holds PETSc's copy of the communicator, so that to destroy objects is no collective operation. */
static MPI_Comm held = MPI_COMM_NULL;

static PetscErrorCode start(void) {
    PetscBool is_started;
    PetscFunctionBegin;
    PetscCall(PetscInitialized(&is_started));
    if (is_started) PetscFunctionReturn(0);
    /* The program has its own handlers of signals. */
    PetscCall(PetscOptionsSetValue(NULL, "-no_signal_handler", "true"));
    PetscCall(PetscInitializeNoArguments());
    PetscCall(PetscPushErrorHandler(keep, NULL));
    PetscCall(PetscCommDuplicate(PETSC_COMM_WORLD, &held, NULL));
    PetscFunctionReturn(0);
}

int variational_petsc_finish(void) {
    PetscBool is_started;
    if (PetscInitialized(&is_started) || !is_started) return 0;
    if (PetscCommDestroy(&held)) return 1;
    return PetscFinalize();
}

void variational_petsc_free(struct solver *solver) {
    PetscBool is_ended = PETSC_TRUE;
    if (!solver || PetscFinalized(&is_ended) || is_ended) return;
    (void)!KSPDestroy(&solver->ksp);
    (void)!MatDestroy(&solver->matrix);
    (void)!VecDestroy(&solver->load);
    (void)!VecDestroy(&solver->solution);
    free(solver);
}

/* Makes a matrix with `rows` rows of blocks on this rank, and conjugate gradients for it. */
static PetscErrorCode make(struct solver *solver, PetscInt block, PetscInt rows, const unsigned *starts,
                           const unsigned *columns) {
    PetscInt *own, *others, end, first;
    PC pc;
    PetscFunctionBegin;
    PetscCall(MatCreate(PETSC_COMM_WORLD, &solver->matrix));
    PetscCall(MatSetSizes(solver->matrix, rows * block, rows * block, PETSC_DETERMINE, PETSC_DETERMINE));
    PetscCall(MatSetBlockSize(solver->matrix, block));
    PetscCall(MatSetType(solver->matrix, MATAIJ));
    end = rows;
    PetscCallMPI(MPI_Scan(MPI_IN_PLACE, &end, 1, MPIU_INT, MPI_SUM, PETSC_COMM_WORLD));
    first = end - rows;
    PetscCall(PetscCalloc2(rows, &own, rows, &others));
    for (PetscInt row = 0; row < rows; row++)
        for (unsigned k = starts[row]; k < starts[row + 1]; k++)
            if ((PetscInt)columns[k] >= first && (PetscInt)columns[k] < end)
                own[row]++;
            else
                others[row]++;
    PetscCall(MatXAIJSetPreallocation(solver->matrix, block, own, others, NULL, NULL));
    PetscCall(PetscFree2(own, others));
    PetscCall(MatSetOption(solver->matrix, MAT_SYMMETRIC, PETSC_TRUE));
    PetscCall(MatSetOption(solver->matrix, MAT_SYMMETRY_ETERNAL, PETSC_TRUE));
    PetscCall(MatCreateVecs(solver->matrix, &solver->solution, &solver->load));
    PetscCall(KSPCreate(PETSC_COMM_WORLD, &solver->ksp));
    PetscCall(KSPSetType(solver->ksp, KSPCG));
    PetscCall(KSPSetNormType(solver->ksp, KSP_NORM_NATURAL));
    PetscCall(KSPGetPC(solver->ksp, &pc));
    PetscCall(PCSetType(pc, PCGAMG));
    PetscCall(KSPSetFromOptions(solver->ksp));
    PetscFunctionReturn(0);
}

/* Takes the numbers of the matrix, and the rigid motions of the positions of its nodes. */
static PetscErrorCode fill(struct solver *solver, PetscInt block, PetscInt rows, const unsigned *starts,
                           const unsigned *columns, const double *values, const double *positions) {
    PetscInt first, end;
    PetscFunctionBegin;
    PetscCall(MatGetOwnershipRange(solver->matrix, &first, &end));
    for (PetscInt row = 0; row < rows; row++) {
        PetscInt number = first / block + row, count = (PetscInt)(starts[row + 1] - starts[row]);
        PetscCall(MatSetValuesBlocked(solver->matrix, 1, &number, count, (const PetscInt *)columns + starts[row],
                                      values + (size_t)starts[row] * block * block, INSERT_VALUES));
    }
    PetscCall(MatAssemblyBegin(solver->matrix, MAT_FINAL_ASSEMBLY));
    PetscCall(MatAssemblyEnd(solver->matrix, MAT_FINAL_ASSEMBLY));
    if (block > 1) {
        Vec places;
        PetscScalar *array;
        MatNullSpace motions;
        PetscCall(VecDuplicate(solver->load, &places));
        PetscCall(VecSetBlockSize(places, block));
        PetscCall(VecGetArray(places, &array));
        PetscCall(PetscArraycpy(array, positions, rows * block));
        PetscCall(VecRestoreArray(places, &array));
        PetscCall(MatNullSpaceCreateRigidBody(places, &motions));
        PetscCall(MatSetNearNullSpace(solver->matrix, motions));
        PetscCall(MatNullSpaceDestroy(&motions));
        PetscCall(VecDestroy(&places));
    }
    PetscCall(KSPSetOperators(solver->ksp, solver->matrix, solver->matrix));
    PetscFunctionReturn(0);
}

/* Takes a matrix; makes the solver if it is NULL. */
int variational_petsc_prepare(struct solver **solver, int block, int rows, const unsigned *starts,
                              const unsigned *columns, const double *values, const double *positions) {
    _Static_assert(sizeof(PetscInt) == sizeof(unsigned),
                   "PETSc was built for indices of 64 bits: install the one for 32 bits (Debian: libpetsc-real-dev)");
    int error = start();
    if (!error && !*solver) {
        *solver = calloc(1, sizeof **solver);
        error = *solver ? make(*solver, block, rows, starts, columns) : PETSC_ERR_MEM;
    }
    return error ? error : fill(*solver, block, rows, starts, columns, values, positions);
}

static PetscErrorCode solve(struct solver *solver, const double *load, double *solution, double tolerance, int most,
                            int *iterations, const char **reason) {
    PetscInt length, count;
    PetscScalar *array;
    const PetscScalar *found;
    KSPConvergedReason outcome;
    PetscFunctionBegin;
    PetscCall(VecGetLocalSize(solver->load, &length));
    PetscCall(VecGetArray(solver->load, &array));
    PetscCall(PetscArraycpy(array, load, length));
    PetscCall(VecRestoreArray(solver->load, &array));
    PetscCall(KSPSetTolerances(solver->ksp, tolerance, PETSC_DEFAULT, PETSC_DEFAULT, most));
    PetscCall(KSPSolve(solver->ksp, solver->load, solver->solution));
    PetscCall(KSPGetConvergedReason(solver->ksp, &outcome));
    PetscCall(KSPGetIterationNumber(solver->ksp, &count));
    *iterations = (int)count;
    *reason = outcome > 0 ? NULL : KSPConvergedReasons[outcome];
    PetscCall(VecGetArrayRead(solver->solution, &found));
    PetscCall(PetscArraycpy(solution, found, length));
    PetscCall(VecRestoreArrayRead(solver->solution, &found));
    PetscFunctionReturn(0);
}

/* Solves; `reason` is why the tolerance is not reached, NULL if it is. */
int variational_petsc_solve(struct solver *solver, const double *load, double *solution, double tolerance, int most,
                            int *iterations, const char **reason) {
    return solve(solver, load, solution, tolerance, most, iterations, reason);
}
